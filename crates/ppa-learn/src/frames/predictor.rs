//! What networks say of the frames of both cameras.

use std::path::{Path, PathBuf};

use candle_core::{Device, Tensor};
use ppa_dataset::layout::View;
use serde::Serialize;

use super::camera::Camera;
use crate::data::{Roi, Views};
use crate::network::{EfficientNetB0, Mode, NetworkError};
use crate::train::{TrainError, trained};

/// Why frames cannot be judged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FramesError {
    /// A training that is not finished, or a frame that cannot be used.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// A network for other images.
    #[error("{} was trained with views = {found:?}, which is no network for the {expected} camera", run.display())]
    Views {
        /// Folder of the training.
        run: PathBuf,
        /// What it was trained on.
        found: Views,
        /// The camera that it shall judge.
        expected: &'static str,
    },
}

/// Quality of a pose from 1 (ideal) to 3 (inadequate), as networks see it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PairPrediction {
    /// From the left camera's frame.
    pub left: f64,
    /// From the right camera's frame.
    pub right: f64,
    /// The mean of both: the paper's answer for a pose.
    pub quality: f64,
}

/// The networks of both cameras. The paper's are separate, each trained on its own view, with averaged outputs.
#[derive(Debug)]
pub struct PairPredictor {
    views: [ViewPredictor; 2],
}

#[derive(Debug)]
struct ViewPredictor {
    network: EfficientNetB0,
    side: usize,
    camera: Camera,
}

impl PairPredictor {
    /// The networks in the folders of two finished trainings, for the left and for the right camera, and where each camera's
    /// frames show the joint. A network of a unified view may be given for both.
    ///
    /// # Errors
    /// [`FramesError`] naming the folder.
    pub fn new(runs: [&Path; 2], regions: [Roi; 2]) -> Result<Self, FramesError> {
        let view = |run: &Path, view: View, roi| {
            let (config, network) = trained(run)?;
            let own = match view {
                View::Left => Views::Left,
                View::Right => Views::Right,
            };
            if config.views != own && config.views != Views::Unified {
                return Err(FramesError::Views {
                    run: run.to_owned(),
                    found: config.views,
                    expected: view.name(),
                });
            }
            Ok(ViewPredictor {
                network,
                side: config.side,
                camera: Camera::new(view, roi),
            })
        };
        Ok(Self {
            views: [
                view(runs[0], View::Left, regions[0])?,
                view(runs[1], View::Right, regions[1])?,
            ],
        })
    }

    /// Reads the left and the right camera's frame and judges them, each on a thread of its own where there are two.
    ///
    /// # Errors
    /// [`FramesError`] naming the frame that cannot be used.
    pub fn predict(&self, frames: [&Path; 2]) -> Result<PairPrediction, FramesError> {
        let [of_left, of_right] = &self.views;
        let (left, right) = rayon::join(
            || of_left.predict(frames[0]),
            || of_right.predict(frames[1]),
        );
        let (left, right) = (left?, right?);
        Ok(PairPrediction {
            left,
            right,
            quality: (left + right) / 2.0,
        })
    }
}

impl ViewPredictor {
    fn predict(&self, frame: &Path) -> Result<f64, TrainError> {
        let side = self.side;
        let values = self.camera.input(frame, side)?.into_values();
        let image = Tensor::from_vec(values, (1, 1, side, side), &Device::Cpu);
        let image = image.map_err(NetworkError::from)?;
        let quality = self.network.forward(&image, Mode::Eval)?;
        let quality = quality.flatten_all().and_then(|all| all.to_vec1::<f32>());
        Ok(f64::from(quality.map_err(NetworkError::from)?[0]))
    }
}
