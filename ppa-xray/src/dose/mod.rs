//! Energy imparted to the phantom, and air kerma.

pub(crate) mod air_kerma;
pub(crate) mod map;
pub(crate) mod report;
pub(crate) mod score;
pub(crate) mod settings;
pub(crate) mod setup;
pub(crate) mod tally;
pub(crate) mod voxel_labels;
