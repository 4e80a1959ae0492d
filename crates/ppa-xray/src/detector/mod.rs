//! What photons at the detector plane become: grid, converter layer.

pub(crate) mod absorption;
pub(crate) mod energy_nodes;
pub(crate) mod fluorescence;
pub(crate) mod grid;
pub(crate) mod open_field;
pub(crate) mod receptor;
pub(crate) mod response;
