//! Evaluation of predictions: metrics by image, pose and person, confusion, calibration, errors by angle, figures.

mod error;
mod figure;
mod figures;
mod folder;
mod poses;
mod report;
mod row;
mod scores;

pub use error::EvaluateError;
pub use figure::{Figure, Mark, Series, Tile};
pub use figures::{calibration_figure, confusion_figure, error_figure, learning_curve, scatter};
pub use folder::{evaluation_files, write_evaluation, write_predictions};
pub(crate) use poses::triple;
pub use poses::{PoseRow, frame_spread, poses};
pub use report::{Evaluation, PersonScores};
pub use row::Row;
pub use scores::Scores;
