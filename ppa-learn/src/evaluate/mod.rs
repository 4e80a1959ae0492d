//! Evaluation of predictions: metrics by image, pose and person, confusion, calibration, errors by angle.

mod error;
mod folder;
mod poses;
mod report;
mod row;
mod scores;

pub use error::EvaluateError;
pub use folder::{EVALUATION_TABLES, write_evaluation, write_predictions};
pub(crate) use poses::triple;
pub use poses::{PoseRow, frame_spread, poses};
pub use report::{Evaluation, PersonScores};
pub use row::Row;
pub use scores::Scores;
