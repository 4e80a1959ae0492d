//! Errors of training runs.

use std::io;
use std::path::{Path, PathBuf};

use ppa_dataset::FileError;

use crate::DeviceError;
use crate::data::DataError;
use crate::network::NetworkError;
use crate::weights::WeightsError;

use super::config_error::ConfigError;
use super::finite::NonFinite;

/// Error in starting, resuming or evaluating a training run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrainError {
    /// An error in the configuration.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A device that cannot be used.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// An error in images, labels or the split.
    #[error(transparent)]
    Data(#[from] DataError),
    /// Corrections should be learned, but none is known.
    #[error(
        "correction_weight is more than 0, but no training sample has a correction: expected rotated poses, not all inadequate"
    )]
    NoCorrection,
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// An error of the network.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// Weights that do not fit, or cannot be read or written.
    #[error(transparent)]
    Weights(Box<WeightsError>),
    /// A file that is not a checkpoint of this network.
    #[error("{} is not a checkpoint of this training: {message}", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What was found and what was expected.
        message: String,
    },
    /// A folder with weights, but without a checkpoint to resume from.
    #[error("{} exists without a checkpoint to resume from; use another folder", .0.display())]
    WeightsAlone(PathBuf),
    /// The folder for a training run is a dataset.
    #[error("{} is a dataset; choose another folder for the training", .0.display())]
    Dataset(PathBuf),
    /// A training run that is not finished, although a finished one is needed.
    #[error("the training in {} is not finished: {step} of {} are done; repeat `ppa train` to resume", folder.display(), ppa_core::text::count(*steps, "step"))]
    Unfinished {
        /// The folder.
        folder: PathBuf,
        /// Number of steps in its checkpoint.
        step: u64,
        /// Total number of steps.
        steps: u64,
    },
    /// The folder of another training run, or of something else.
    #[error("{} holds another configuration, with no checkpoint next to it to resume from; choose another folder", .0.display())]
    OtherConfig(PathBuf),
    /// A loss or gradient that is not finite.
    #[error("step {step}: the loss is {loss}; {place}")]
    NotFinite {
        /// The step, from 0.
        step: u64,
        /// Its loss.
        loss: f32,
        /// Where the first non-finite number appeared.
        place: NonFinite,
    },
    /// An error of candle.
    #[error("a computation failed")]
    Candle(#[from] candle_core::Error),
}

impl From<WeightsError> for TrainError {
    fn from(error: WeightsError) -> Self {
        Self::Weights(Box::new(error))
    }
}

/// Returns a function that adds the action and the file to an I/O error.
pub(super) fn at<'a>(
    action: &'static str,
    path: &'a Path,
) -> impl FnOnce(io::Error) -> FileError + 'a {
    move |source| FileError {
        action,
        path: path.to_owned(),
        source,
    }
}
