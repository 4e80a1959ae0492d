//! The patient: materials and densities on a lattice of voxels.

pub(crate) mod audit;
mod built_in_calibration;
pub(crate) mod calibration_error;
pub(crate) mod graded_mixture;
pub(crate) mod histogram;
pub(crate) mod hu;
pub(crate) mod interpolation;
pub(crate) mod lattice;
pub(crate) mod segment;
pub(crate) mod segmentation;
pub(crate) mod voxels;
