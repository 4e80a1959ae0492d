//! Prediction on depth images as two cameras deliver them, pair by pair.
//!
//! [`PairPredictor`] holds the networks of finished trainings; [`PairFolder`] finds the pairs of a folder that a recorder fills;
//! [`StreamJudge`] judges them as they come, or those that lines of text name.
//! Frames are 16-bit PNG in mm, cut, resized and shifted as for evaluation.

mod calibrate;
mod camera;
mod confidence;
mod error;
mod folder;
mod networks;
mod predictor;
mod stream;

pub use calibrate::Calibration;
pub use confidence::Confidence;
pub use error::FramesError;
pub use folder::{FramePair, PairFolder};
pub use networks::of_camera;
pub use predictor::{Answer, PairPrediction, PairPredictor, Trust};
pub use stream::{SkippedPair, StreamAnswer, StreamError, StreamJudge, StreamSummary};
