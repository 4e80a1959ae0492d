//! What photons at the detector plane become: grid, converter layer, blur, electronics.

pub(crate) mod absorption;
pub(crate) mod blur;
pub(crate) mod energy_nodes;
pub(crate) mod grid;
pub(crate) mod open_field;
pub(crate) mod readout;
pub(crate) mod receptor;
pub(crate) mod response;
