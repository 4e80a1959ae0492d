//! Errors of predictions on frames.

use std::path::PathBuf;

use crate::confidence::ConfidenceError;
use crate::data::Views;
use crate::train::TrainError;

/// Error in predicting the quality of frames or in a calibration.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FramesError {
    /// An unfinished training run, or a frame that cannot be used.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// A network for other images.
    #[error("{} was trained with views = \"{found}\", expected {expected}", run.display())]
    Views {
        /// Folder of the training run.
        run: PathBuf,
        /// Views it was trained on.
        found: Views,
        /// Views it could have been trained on.
        expected: &'static str,
    },
    /// The network shows left limbs as right ones, but no side is given.
    #[error("{} was trained with mirror = true: state whether the frames show a left or a right limb", run.display())]
    Side {
        /// Folder of the training run.
        run: PathBuf,
    },
    /// A frame unlike those that the networks were trained with.
    #[error("{} is unlike the training images: its distance from them is {distance:.2} times the limit", frame.display())]
    OutOfDistribution {
        /// The frame.
        frame: PathBuf,
        /// Its distance as a share of the limit.
        distance: f32,
    },
    /// A confidence file that cannot be read or belongs to other networks.
    #[error("{}: {message}", path.display())]
    Confidence {
        /// The file.
        path: PathBuf,
        /// The cause.
        message: String,
    },
    /// Poses from which no intervals can be computed.
    #[error(transparent)]
    Calibration(#[from] ConfidenceError),
    /// Too few images for the limits of the detector.
    #[error(
        "{training} training images and {calibration} calibration images, expected at least 5 and 99"
    )]
    FewImages {
        /// Training images of a network.
        training: usize,
        /// Calibration images of an input.
        calibration: usize,
    },
    /// Networks of which only one shows left limbs as right ones.
    #[error("{} was trained with mirror = {left}, {} with mirror = {}; both must be equal", runs[0].display(), runs[1].display(), !left)]
    Mirror {
        /// Folders of the left and the right camera's training runs.
        runs: [PathBuf; 2],
        /// Setting of the first.
        left: bool,
    },
}
