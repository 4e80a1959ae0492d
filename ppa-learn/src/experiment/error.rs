//! Errors of experiments.

use std::path::PathBuf;

use ppa_dataset::FileError;
use ppa_dataset::published::PublishedError;

use super::configuration::Experiment;
use super::folds::FoldError;
use super::predictions::PredictionError;
use super::table::Incomplete;
use crate::evaluate::EvaluateError;
use crate::train::{ConfigError, TrainError};

/// Error in running or evaluating an experiment.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExperimentError {
    /// The plan cannot be used.
    #[error("{}: {message}", path.display())]
    Plan {
        /// The file.
        path: PathBuf,
        /// The error and its position.
        message: String,
    },
    /// An error in the plan's training configuration.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The plan names no dataset for an experiment.
    #[error("experiment {} needs [{key}] in the plan", experiment.name())]
    NoTarget {
        /// The experiment.
        experiment: Experiment,
        /// The missing key.
        key: &'static str,
    },
    /// An error in the dataset.
    #[error(transparent)]
    Dataset(#[from] PublishedError),
    /// An error in the folds.
    #[error(transparent)]
    Folds(#[from] FoldError),
    /// An error in a training run.
    #[error("{training}")]
    Training {
        /// The training run.
        training: String,
        /// The cause.
        source: Box<TrainError>,
    },
    /// Unusable data of training runs.
    #[error("{unusable} of {trainings} training runs of each seed cannot start: {problems}")]
    Unusable {
        /// Number of training runs of one seed that cannot start.
        unusable: usize,
        /// Number of training runs of one seed.
        trainings: usize,
        /// Problems with their data.
        problems: String,
    },
    /// The folder of a training run holds results of other settings or data.
    #[error("{} was made with other settings or data; choose another folder", .0.display())]
    OtherSettings(PathBuf),
    /// Predictions that cannot be read.
    #[error("{} cannot be read: {message}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The cause.
        message: String,
    },
    /// Predictions that cannot be evaluated.
    #[error("{place}")]
    Predictions {
        /// Column, seed and fold.
        place: String,
        /// The cause.
        source: PredictionError,
    },
    /// Results are missing.
    #[error(transparent)]
    Incomplete(#[from] Incomplete),
    /// Predictions that cannot be written.
    #[error(transparent)]
    Write(#[from] EvaluateError),
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
}
