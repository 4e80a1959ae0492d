//! Predictions for the frames of both cameras.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use candle_core::{Device, Tensor};
use ppa_core::Roi;
use ppa_dataset::layout::{Side, View};
use ppa_metrics::NON_DIAGNOSTIC;
use serde::Serialize;

use super::camera::Camera;
use super::confidence::Confidence;
use super::error::FramesError;
use super::networks::Networks;
use crate::DeviceName;
use crate::data::{DataError, Raster};
use crate::train::TrainError;

/// Predicted quality of a pose, from 1 (ideal) to 3 (inadequate).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PairPrediction {
    /// Quality from the left camera's frame alone, unless one network takes both frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left: Option<f64>,
    /// Quality from the right camera's frame alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub right: Option<f64>,
    /// Mean of both, which is the paper's prediction for a pose, or the prediction of one network for both frames.
    pub quality: f64,
    /// Medial rotation in degrees that would bring the limb into its best pose, lateral if negative: the mean of both networks, if they
    /// predict it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub correction_deg: Option<f64>,
    /// Confidence in the quality, if it was calibrated.
    #[serde(flatten)]
    pub trust: Option<Trust>,
}

/// Confidence in a quality.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Trust {
    /// Interval that contains the label with the probability of the calibration.
    pub interval: [f64; 2],
    /// Whether the pose is diagnostic according to the interval.
    pub diagnostic: Answer,
}

/// Whether a pose is diagnostic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Answer {
    /// The interval is below 2.5.
    Yes,
    /// The interval is at or above 2.5.
    No,
    /// The interval contains both.
    NotSure,
}

impl Trust {
    /// Derives the answer from an interval.
    fn of(interval: [f64; 2]) -> Self {
        let diagnostic = match interval {
            [_, high] if high < NON_DIAGNOSTIC => Answer::Yes,
            [low, _] if low >= NON_DIAGNOSTIC => Answer::No,
            _ => Answer::NotSure,
        };
        Self {
            interval,
            diagnostic,
        }
    }
}

/// Predicts the quality from the frames of both cameras.
#[derive(Debug)]
pub struct PairPredictor {
    networks: Arc<Networks>,
    /// The camera of the left and of the right input.
    inputs: [Camera; 2],
    /// Index of each input's frame in a pair: exchanged for mirrored limbs.
    frames: [usize; 2],
    confidence: Option<Arc<Confidence>>,
}

impl PairPredictor {
    /// Opens the networks in the folders of finished training runs: the left and the right camera's network, as in the paper, or one
    /// network of a unified view or of pairs. `regions` are the regions of the joint in each camera's frames. `side` is the side of the
    /// limb; networks that were trained with `mirror` need it.
    ///
    /// # Errors
    /// [`FramesError`] naming the folder, or the device that cannot be used.
    pub fn new(
        left: &Path,
        right: Option<&Path>,
        regions: [Roi; 2],
        side: Option<Side>,
        device: DeviceName,
    ) -> Result<Self, FramesError> {
        let networks = Networks::open(left, right, device)?;
        let run = left.to_owned();
        // If a left limb is shown as a right one, the left camera's frame goes to the right input.
        let mirrored = match (networks.of_inputs()[0].config.mirror, side) {
            (true, None) => return Err(FramesError::Side { run }),
            (true, Some(side)) => side == Side::Left,
            (false, _) => false,
        };
        let views = [View::Left, View::Right];
        let frames = if mirrored { [1, 0] } else { [0, 1] };
        Ok(Self {
            networks: Arc::new(networks),
            inputs: frames.map(|frame| Camera::new(views[frame], regions[frame], mirrored)),
            frames,
            confidence: None,
        })
    }

    /// Adds intervals, and refuses frames unlike the training images, according to a confidence file calibrated with the same networks.
    ///
    /// # Errors
    /// [`FramesError::Confidence`].
    pub fn with_confidence(self, path: &Path) -> Result<Self, FramesError> {
        let confidence = Some(Arc::new(Confidence::read(path, &self.networks)?));
        Ok(Self { confidence, ..self })
    }

    /// Returns a predictor with the same networks and other regions of the joint.
    #[must_use]
    pub fn with_regions(&self, regions: [Roi; 2]) -> Self {
        let input = |input: usize| self.inputs[input].with_region(regions[self.frames[input]]);
        Self {
            networks: self.networks.clone(),
            inputs: [input(0), input(1)],
            frames: self.frames,
            confidence: self.confidence.clone(),
        }
    }

    /// Reads the left and the right camera's frame and predicts the quality, both cameras in parallel.
    ///
    /// # Errors
    /// [`FramesError`] naming the frame that cannot be used.
    pub fn predict(&self, frames: [&Path; 2]) -> Result<PairPrediction, FramesError> {
        let image = |input: usize, side: usize| {
            let frame = frames[self.frames[input]];
            self.inputs[input].input(frame, side)
        };
        self.judge(image, frames.map(Path::to_owned))
    }

    /// Predicts the quality from depth images of the left and the right camera in mm, 0 invalid.
    ///
    /// # Errors
    /// [`FramesError`] for a region outside an image, or images unlike those of the training.
    pub fn predict_images(&self, images: [&Raster<u16>; 2]) -> Result<PairPrediction, FramesError> {
        let image = |input: usize, side: usize| {
            let image = images[self.frames[input]];
            self.inputs[input].input_of(image, side)
        };
        let names = ["the left camera's image", "the right camera's image"];
        self.judge(image, names.map(PathBuf::from))
    }

    /// Predicts from the inputs that `image` returns for an input number and the side of its network; `frames` are for error messages.
    fn judge(
        &self,
        image: impl Fn(usize, usize) -> Result<Raster<f32>, DataError> + Sync,
        frames: [PathBuf; 2],
    ) -> Result<PairPrediction, FramesError> {
        let networks = self.networks.of_inputs();
        let image = |input: usize| {
            let of = networks[input];
            let side = of.config.side;
            tensor(image(input, side)?, side, of.network.device())
        };
        let (left, right) = rayon::join(|| image(0), || image(1));
        let moment = self.networks.moments(&[left?, right?])?.remove(0);
        if let Some(confidence) = &self.confidence {
            let distances = confidence.relative_distances(&moment.images);
            for (input, distance) in distances.into_iter().enumerate() {
                if distance > 1.0 {
                    let frame = frames[self.frames[input]].clone();
                    return Err(FramesError::OutOfDistribution { frame, distance });
                }
            }
        }
        let quality = moment.prediction.quality;
        let interval = |confidence: &Arc<Confidence>| confidence.intervals().interval(quality);
        Ok(PairPrediction {
            left: moment.alone.map(|alone| alone[self.frames[0]]),
            right: moment.alone.map(|alone| alone[self.frames[1]]),
            quality,
            correction_deg: moment.prediction.correction_deg,
            trust: self.confidence.as_ref().map(interval).map(Trust::of),
        })
    }
}

/// Returns an image as a tensor [1, 1, side, side] on a device.
fn tensor(image: Raster<f32>, side: usize, device: &Device) -> Result<Tensor, TrainError> {
    let values = image.into_values();
    Ok(Tensor::from_vec(values, (1, 1, side, side), device)?)
}
