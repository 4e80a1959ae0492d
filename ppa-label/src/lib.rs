//! Labels of poses: grades of readers, and labels computed from the bones of an ankle.
//!
//! Readers see the radiographs of a dataset as [`ReaderCase`]s on a [`grading_page`], or one by one in a program that keeps their
//! [`GradeSheet`]; [`import_grades`] turns their grades into labels; [`read_grade_tables`] collects grades by image, for statistics of
//! agreement.
//!
//! Computed labels measure the alignment of the joint space of an ankle with the beam. They are a surrogate that no reader has
//! validated.
//! [`segment_bones`] separates tibia, fibula and talus if the scan has no labelled bones; [`AnkleBones`] are their surfaces;
//! [`JointSpace`] finds the three gutters between them; its `openness` follows the rays of an [`Exposure`]; a [`LabelScale`] turns it
//! into a grade; [`compute_labels`] does so for a dataset, [`PoseLabel`] for one exposure; [`check_bones`] rejects bones of a case from
//! which no labels can be computed.

mod case_bones;
mod computation;
mod computed;
mod described;
mod openness;
mod pose_label;
mod readers;
mod segment;
mod table;
mod tallies;

pub use case_bones::{CaseBonesError, check_bones, check_segmented_name, segment_checked_bones};
pub use computed::{
    AutoLabelError, CaseBones, ComputedLabels, ComputedRow, LabelledLimb, compute_labels,
};
pub use openness::*;
pub use pose_label::{GutterLabel, PoseLabel};
pub use readers::*;
pub use segment::{SegmentError, SegmentedBones, segment_bones};
pub use table::TableError;
pub use tallies::TalliesError;
