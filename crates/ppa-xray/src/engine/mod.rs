//! From an exposure to a radiograph: followed photon by photon, or fast.

pub(crate) mod analog;
#[cfg(test)]
mod energy_balance;
pub(crate) mod fast;
pub(crate) mod noise;
pub(crate) mod raytrace;
#[cfg(test)]
mod scatter_of_a_sphere;
pub(crate) mod upsample;
