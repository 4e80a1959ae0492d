//! Prediction on pairs of depth images from two cameras.
//!
//! [`PairPredictor`] holds the networks of finished training runs; [`PairFolder`] finds pairs in a folder that a recorder fills;
//! [`StreamJudge`] evaluates these pairs as they arrive, or pairs named in lines of text.
//! Frames are 16-bit PNG files in mm, cropped, resized and shifted as for evaluation.

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
