//! Prediction on depth images as two cameras deliver them, pair by pair.
//!
//! [`PairPredictor`] holds the networks of finished trainings; [`PairFolder`] finds the pairs of a folder that a recorder fills;
//! [`StreamJudge`] judges them as they come, or those that lines of text name.
//! Frames are 16-bit PNG in mm, cut, resized and shifted as for evaluation.

mod camera;
mod folder;
mod predictor;
mod stream;

pub use folder::{FramePair, PairFolder};
pub use predictor::{FramesError, PairPrediction, PairPredictor, of_camera};
pub use stream::{SkippedPair, StreamAnswer, StreamError, StreamJudge, StreamSummary};
