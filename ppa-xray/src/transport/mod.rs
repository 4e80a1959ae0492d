//! Transport of photons through the phantom to the detector.
//!
//! The analog engine follows 6 to 15 times as many histories per processor second as the CPU build of MC-GPU v1.3, and up to
//! 66 times as many if there is metal in the box (bench `transport`, docs/performance.md).

pub(crate) mod attenuation;
mod block_classes;
mod lanes;
pub(crate) mod majorants;
pub(crate) mod phantom_tables;
pub(crate) mod score;
pub(crate) mod stream;
pub(crate) mod tally;
pub(crate) mod tracking;
pub(crate) mod voxel_codes;
