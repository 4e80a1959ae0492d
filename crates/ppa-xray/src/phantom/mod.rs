//! The patient: materials and densities on a lattice of voxels.

pub(crate) mod graded_bone;
pub(crate) mod hu;
pub(crate) mod lattice;
pub(crate) mod voxels;
