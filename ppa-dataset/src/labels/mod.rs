//! Labels of poses: those of readers and computed ones.
//!
//! [`LabelFile`] is `labels.json`, in which a reader's label wins over a computed one.
//!
//! Readers (feature `generate`): they see the radiographs of a dataset as `Showing`s on a `grading_page`; `import_grades`
//! makes labels of what they say.
//!
//! Computed labels (feature `generate`) say how open the joint space of an ankle lies to the beam. `segment_bones` tells tibia,
//! fibula and talus apart where nobody did; `AnkleBones` are their surfaces; `JointSpace` finds the three gutters between them; its `openness` follows the rays of an
//! `Exposure`; `GradeThresholds` make a grade of it; `compute_labels` does so for a dataset. What is computed here is a surrogate: no reader has confirmed it.

#[cfg(feature = "generate")]
mod computation;
#[cfg(feature = "generate")]
mod computed;
#[cfg(feature = "generate")]
mod described;
mod file;
mod label;
#[cfg(feature = "generate")]
mod openness;
#[cfg(feature = "generate")]
mod readers;
#[cfg(feature = "generate")]
mod segment;
#[cfg(feature = "generate")]
mod table;
#[cfg(feature = "generate")]
mod tallies;

#[cfg(feature = "generate")]
pub use computed::{AutoLabelError, ComputedLabels, ComputedRow, LabelledLimb, compute_labels};
pub use file::{LabelFile, LabelFileError};
pub use label::{LabelError, LabelRow, LabelSource};
pub(crate) use label::{Sources, name_of};
#[cfg(feature = "generate")]
pub use openness::*;
#[cfg(feature = "generate")]
pub use readers::*;
#[cfg(feature = "generate")]
pub use segment::{SegmentError, SegmentedBones, segment_bones};
#[cfg(feature = "generate")]
pub use table::TableError;
#[cfg(feature = "generate")]
pub use tallies::TalliesError;
