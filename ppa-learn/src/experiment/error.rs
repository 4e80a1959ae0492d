//! Why an experiment cannot be run or judged.

use std::path::PathBuf;

use ppa_dataset::FileError;
use ppa_dataset::published::PublishedError;

use super::configuration::Experiment;
use super::folds::FoldError;
use super::predictions::PredictionError;
use super::table::Incomplete;
use crate::evaluate::EvaluateError;
use crate::train::{ConfigError, TrainError};

/// Why an experiment cannot be run or judged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExperimentError {
    /// The plan cannot be used.
    #[error("{}: {message}", path.display())]
    Plan {
        /// The file.
        path: PathBuf,
        /// What and where.
        message: String,
    },
    /// What the plan says of the training.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The plan names no dataset for an experiment.
    #[error("experiment {} needs [{key}] in the plan", experiment.name())]
    NoTarget {
        /// The experiment.
        experiment: Experiment,
        /// The key.
        key: &'static str,
    },
    /// The dataset.
    #[error(transparent)]
    Dataset(#[from] PublishedError),
    /// The folds.
    #[error(transparent)]
    Folds(#[from] FoldError),
    /// A training.
    #[error("{training}")]
    Training {
        /// Which one.
        training: String,
        /// What was wrong.
        source: Box<TrainError>,
    },
    /// Data that trainings need and that cannot be used.
    #[error("{unusable} of {trainings} training runs of each seed cannot start: {problems}")]
    Unusable {
        /// Trainings of one seed that cannot begin.
        unusable: usize,
        /// Trainings of one seed.
        trainings: usize,
        /// What is wrong with their data.
        problems: String,
    },
    /// Results of other settings or data where those of a training should go.
    #[error("{} was made with other settings or data; choose another folder", .0.display())]
    OtherSettings(PathBuf),
    /// Predictions that cannot be read.
    #[error("{} cannot be read: {message}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// Predictions that cannot be judged.
    #[error("{place}")]
    Predictions {
        /// Column, seed and fold.
        place: String,
        /// What is wrong.
        source: PredictionError,
    },
    /// Results are missing.
    #[error(transparent)]
    Incomplete(#[from] Incomplete),
    /// Predictions that cannot be written.
    #[error(transparent)]
    Write(#[from] EvaluateError),
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
}
