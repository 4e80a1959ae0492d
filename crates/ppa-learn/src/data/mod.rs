//! From depth images to what the network sees: regions of interest, augmentation, balanced sampling, loading.
//!
//! A 16-bit image in mm is cut to the square around the joint and brought to 1.2 times the network's side
//! ([`prepare`]); training augments ([`Augmentation`]), evaluation only resizes ([`evaluation_input`]). Depths are divided by
//! [`RANGE_MM`] and shifted by −0.5; invalid pixels are 0 in mm and −0.5 for the network.

mod augment;
mod blur;
mod error;
mod gradient;
mod prepare;
mod raster;
mod rotate;

pub use augment::Augmentation;
pub use blur::box_blur;
pub use error::DataError;
pub use gradient::{gradient, quantile};
pub use prepare::{RANGE_MM, Roi, evaluation_input, prepare, prepared_side};
pub use raster::Raster;
pub use rotate::rotate;
