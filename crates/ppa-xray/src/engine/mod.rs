//! From an exposure to a radiograph: followed photon by photon, or fast.

pub(crate) mod analog;
#[cfg(test)]
mod energy_balance;
pub(crate) mod fast;
pub(crate) mod noise;
pub(crate) mod raytrace;
pub(crate) mod upsample;
