//! Why a training cannot begin, continue or be evaluated.

use std::io;
use std::path::{Path, PathBuf};

use ppa_dataset::FileError;

use crate::DeviceError;
use crate::data::DataError;
use crate::network::NetworkError;
use crate::weights::WeightsError;

use super::config_error::ConfigError;
use super::finite::NonFinite;

/// Why a training cannot begin, continue or be evaluated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrainError {
    /// The configuration.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A device that cannot be used.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// Images, labels or the split.
    #[error(transparent)]
    Data(#[from] DataError),
    /// Corrections to learn, and none known.
    #[error(
        "correction_weight is more than 0, but no training sample has a correction: expected rotated poses, not all inadequate"
    )]
    NoCorrection,
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
    /// The network.
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
        /// What was found and what expected.
        message: String,
    },
    /// A folder with weights, but nothing to continue from.
    #[error("{} exists without a checkpoint to resume from; use another folder", .0.display())]
    WeightsAlone(PathBuf),
    /// A dataset where a training was to be written.
    #[error("{} is a dataset; choose another folder for the training", .0.display())]
    Dataset(PathBuf),
    /// A training that is not finished, where a finished one is needed.
    #[error("the training in {} is not finished: {step} of {} are done; repeat `ppa train` to resume", folder.display(), ppa_core::text::count(*steps, "step"))]
    Unfinished {
        /// The folder.
        folder: PathBuf,
        /// Steps that its checkpoint holds.
        step: u64,
        /// Steps of the whole training.
        steps: u64,
    },
    /// A folder of another training, or of something else.
    #[error("{} holds another configuration, with no checkpoint next to it to resume from; choose another folder", .0.display())]
    OtherConfig(PathBuf),
    /// Numbers that are not finite.
    #[error("step {step}: the loss is {loss}; {place}")]
    NotFinite {
        /// The step, from 0.
        step: u64,
        /// Its loss.
        loss: f32,
        /// Where it began.
        place: NonFinite,
    },
    /// candle's arithmetic.
    #[error("a computation failed")]
    Candle(#[from] candle_core::Error),
}

impl From<WeightsError> for TrainError {
    fn from(error: WeightsError) -> Self {
        Self::Weights(Box::new(error))
    }
}

/// Names the file and what was done to it.
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
