//! What predictions are worth: metrics by image, pose and person, confusion, calibration, errors by angle, and figures.

mod figure;
mod figures;
mod folder;
mod report;
mod row;
mod scores;

pub use figure::{Figure, Mark, Series};
pub use figures::{calibration_figure, error_figure, learning_curve, scatter};
pub use folder::{EvaluateError, write_evaluation, write_predictions};
pub use report::{Evaluation, PersonScores};
pub use row::Row;
pub use scores::Scores;
