//! Labels of poses: those of readers and computed ones.
//!
//! [`LabelFile`] is `labels.json`, in which the two never mix.
//!
//! Computed labels (feature `generate`) say how open the joint space of an ankle lies to the beam. `AnkleBones` tells tibia, fibula and talus apart; `JointSpace` finds the three gutters between them; its
//! `openness` follows the rays of an `Exposure`; `GradeThresholds` make a grade of it. What is computed here is a surrogate: no
//! reader has confirmed it.

#[cfg(feature = "generate")]
mod bones;
#[cfg(feature = "generate")]
mod exposure;
mod file;
#[cfg(feature = "generate")]
mod grade;
#[cfg(feature = "generate")]
mod gutter;
#[cfg(feature = "generate")]
mod joint_space;
mod label;
#[cfg(feature = "generate")]
mod rays;

#[cfg(feature = "generate")]
pub use bones::{AnkleBone, AnkleBones, BoneNumbers, BonesError};
#[cfg(feature = "generate")]
pub use exposure::Exposure;
pub use file::{LabelFile, LabelFileError};
#[cfg(feature = "generate")]
pub use grade::{ComputedLabel, GradeThresholds, ThresholdError};
#[cfg(feature = "generate")]
pub use joint_space::{FREE_CHORDS_MM, Gutter, JointSpace, JointSpaceError, Openness};
pub use label::{LabelError, LabelRow, LabelSource};
