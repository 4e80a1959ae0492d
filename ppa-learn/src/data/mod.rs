//! Conversion of depth images to network input: regions of interest, augmentation, balanced sampling, loading.
//!
//! A 16-bit image in mm is cropped to the square around the joint and resized to 1.2 times the side of the network's input
//! ([`prepare`]); training augments it ([`Augmentation`]), evaluation only resizes it ([`evaluation_input`]). Depths are divided by
//! [`RANGE_MM`] and shifted by −0.5; invalid pixels are 0 in mm and −0.5 for the network.
//!
//! [`read_samples`] lists the samples of a dataset in either published layout; [`Loader`] makes batches: an endless sequence for
//! training, balanced over the labels or not ([`Balanced`]), and each sample once for evaluation.

mod augment;
mod balance;
mod blur;
mod correction;
mod dataset;
mod error;
mod gradient;
mod images;
mod loader;
mod lost_pixels;
mod prepare;
mod raster;
mod rotate;
mod sample;
mod size;

pub use augment::Augmentation;
pub use balance::{BUCKETS, Balanced, bucket};
pub use blur::box_blur;
pub use dataset::{FRAMES_PER_POSE, Selection, Views, read_samples};
pub use error::DataError;
pub use gradient::{gradient, quantile};
pub use images::Images;
pub use loader::{Batch, Loader, Order};
pub use prepare::{RANGE_MM, evaluation_input, prepare, prepared_side};
pub use raster::Raster;
pub use rotate::rotate;
#[cfg(test)]
pub(crate) use sample::tests::sample as sample_without_images;
pub use sample::{Sample, SampleImage, check_split};
