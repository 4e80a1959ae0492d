//! Response of the detector to photons: grid, converter layer, blur, electronics.

pub(crate) mod absorption;
pub(crate) mod blur;
mod check;
pub(crate) mod energy_nodes;
mod escape;
pub(crate) mod gains;
pub(crate) mod grid;
pub(crate) mod kernel;
mod layer;
mod layer_response;
pub(crate) mod lubberts;
pub(crate) mod mtf;
pub(crate) mod open_field;
mod quadrature;
pub(crate) mod readout;
pub(crate) mod response;
pub(crate) mod strip_pattern;
pub(crate) mod tabulated_response;
