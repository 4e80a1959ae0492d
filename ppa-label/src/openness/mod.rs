//! Computed labels: alignment of the joint space of an ankle with the beam.

mod blocks;
mod bone_file;
mod bones;
mod exposure;
mod fan;
mod gap_voxels;
mod gutter;
mod hidden;
mod joint_space;
mod overlap;
mod rays;
mod scale;
mod visibility;
mod visible;

#[cfg(test)]
mod tests;

pub use bone_file::{BoneFileError, ReadBones, read_bones};
pub(crate) use bones::box_around;
pub use bones::{AnkleBone, AnkleBones, BonesError};
pub use exposure::Exposure;
pub use hidden::{Hidden, HiddenGutters};
pub use joint_space::{FREE_CHORDS_MM, Gutter, JointSpace, JointSpaceError, Openness};
pub use overlap::Overlaps;
pub use scale::{
    ComputedLabel, GradedThresholds, LabelScale, OpennessReference, ScaleError, ScaleName,
    StrictThresholds, UnknownScale,
};
pub use visibility::{Reading, Visibility};
