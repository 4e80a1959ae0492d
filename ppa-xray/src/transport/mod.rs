//! Photons on their way through the phantom to the detector.

pub(crate) mod attenuation;
mod block_classes;
mod lanes;
pub(crate) mod majorants;
pub(crate) mod score;
pub(crate) mod stream;
pub(crate) mod tally;
pub(crate) mod tracking;
pub(crate) mod voxel_codes;
