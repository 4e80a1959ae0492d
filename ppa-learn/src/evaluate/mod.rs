//! Evaluation of predictions: metrics by image, pose and person, confusion, calibration, errors by angle, and baselines without a
//! network.

mod baselines;
mod correction;
mod error;
mod folder;
mod kernel_ridge;
mod means;
mod poses;
mod report;
mod row;
mod scores;
mod verdict;

pub use baselines::{Baseline, Baselines};
pub(crate) use baselines::{baseline_predictions, label_noise_mae};
pub use correction::CorrectionScores;
pub use error::EvaluateError;
pub use folder::{EVALUATION_TABLES, write_evaluation, write_predictions};
pub(crate) use means::means;
pub(crate) use poses::triple;
pub use poses::{PoseRow, frame_spread, poses};
pub use report::{Evaluation, PersonScores};
pub use row::Row;
pub use scores::Scores;
pub use verdict::{BaselineKind, Compared, Verdict};
pub(crate) use verdict::{mean_by, p_network_better, sentence, test_of_persons, verdict};
