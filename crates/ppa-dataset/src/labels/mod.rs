//! Labels of poses: those of readers and computed ones.
//!
//! [`LabelFile`] is `labels.json`, in which the two never mix.
//!
//! Computed labels say how open the joint space of an ankle lies to the beam. [`AnkleBones`] tells tibia, fibula and talus apart; [`JointSpace`] finds the three gutters between them; its
//! [`openness`](JointSpace::openness) follows the rays of an [`Exposure`]; [`GradeThresholds`] make a grade of it. What is computed here is a surrogate: no
//! reader has confirmed it.

mod bones;
mod exposure;
mod file;
mod grade;
mod gutter;
mod joint_space;
mod label;
mod rays;

pub use bones::{AnkleBone, AnkleBones, BoneNumbers, BonesError};
pub use exposure::Exposure;
pub use file::{LabelFile, LabelFileError};
pub use grade::{ComputedLabel, GradeThresholds, ThresholdError};
pub use joint_space::{FREE_CHORDS_MM, Gutter, JointSpace, JointSpaceError, Openness};
pub use label::{LabelError, LabelRow, LabelSource};
