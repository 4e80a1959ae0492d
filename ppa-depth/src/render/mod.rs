//! Bodies, and depth images of them without the errors of a sensor.

pub(crate) mod body;
pub(crate) mod body_error;
pub(crate) mod depth_buffer;
pub(crate) mod ideal;
pub(crate) mod inside;
pub(crate) mod mesh_body;
pub(crate) mod nearest;
pub(crate) mod raster;
pub(crate) mod sample_raster;
pub(crate) mod sampled;
pub(crate) mod single_lens;
pub(crate) mod surface;
pub(crate) mod surfel_body;
pub(crate) mod triangle;
pub(crate) mod walls;
