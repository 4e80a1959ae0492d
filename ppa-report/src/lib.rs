//! Pictures and pages for inspecting cases, poses and datasets.
//!
//! [`audit_page`] shows a scan, [`case_picture`] and [`pose_picture`] show one limb, [`contact_sheet`] shows a dataset in one picture
//! ([`growing_contact_sheet`] while it is made), [`qa_page`] is the quality report of a dataset and [`pose_rows`] its data,
//! [`coverage_plot`] shows where a camera sees most of a joint; [`learning_curve`], [`confusion`] and others chart an evaluation,
//! [`experiments_page`] shows the paper's experiments.

mod audit_page;
mod chart;
mod contact_sheet;
mod coverage_plot;
mod drawing;
mod embedded;
mod evaluation;
mod experiments;
mod pictures;
mod qa;

pub use audit_page::audit_page;
pub use chart::{Chart, Mark, Series, Tile};
pub use contact_sheet::{ContactSheetError, contact_sheet, growing_contact_sheet};
pub use coverage_plot::{RankedView, coverage_plot};
pub use evaluation::{
    calibration, confusion, errors_by_amount, errors_by_angle, learning_curve, predictions_by_label,
};
pub use experiments::{ExperimentPart, ResultCell, WorstPose, experiments_page};
pub use pictures::{PosedLimb, case_picture, pose_picture, write_picture};
pub use qa::{PoseRow, QaError, pose_rows, qa_page};
