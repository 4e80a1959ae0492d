//! The radiograph, its presentation and its files.

#[cfg(feature = "dicom")]
pub(crate) mod dx;
mod electronic_noise;
pub(crate) mod enhancement;
pub(crate) mod exposure_index;
mod gains;
mod latitude;
mod layer_sizes;
mod log_exposure;
pub(crate) mod memory;
#[cfg(feature = "files")]
pub(crate) mod output;
pub(crate) mod presentation;
pub(crate) mod pyramid;
pub(crate) mod radiograph;
