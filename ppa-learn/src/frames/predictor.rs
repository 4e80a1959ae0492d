//! Predictions on the frames of both cameras.

use std::path::{Path, PathBuf};

use candle_core::{Device, Tensor};
use ppa_core::Roi;
use ppa_dataset::layout::{Side, View};
use serde::Serialize;

use super::camera::Camera;
use crate::DeviceName;
use crate::data::Views;
use crate::network::{InferenceNetwork, PosePrediction};
use crate::train::{TrainConfig, TrainError, trained};

/// Why frames cannot be judged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FramesError {
    /// A training that is not finished, or a frame that cannot be used.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// A network for other images.
    #[error("{} was trained with views = \"{found}\", expected {expected}", run.display())]
    Views {
        /// Folder of the training.
        run: PathBuf,
        /// What it was trained on.
        found: Views,
        /// What it could have been trained on.
        expected: &'static str,
    },
    /// A network that shows left limbs as right ones, and no side.
    #[error("{} was trained with mirror = true: it must be told whether the frames show a left or a right limb", run.display())]
    Side {
        /// Folder of the training.
        run: PathBuf,
    },
    /// Networks of which only one shows left limbs as right ones.
    #[error("{} was trained with mirror = {left}, {} with mirror = {}; both must be equal", runs[0].display(), runs[1].display(), !left)]
    Mirror {
        /// Folders of the left and the right camera's training.
        runs: [PathBuf; 2],
        /// What the first was trained with.
        left: bool,
    },
}

/// Refuses the training in the folder `run`, on images of `views`, if its network is none for one camera's images.
///
/// # Errors
/// [`FramesError::Views`].
pub fn of_camera(run: &Path, views: Views, camera: View) -> Result<(), FramesError> {
    let (own, expected) = match camera {
        View::Left => (
            Views::Left,
            "\"left\" or \"unified\" for the left camera's network",
        ),
        View::Right => (
            Views::Right,
            "\"right\" or \"unified\" for the right camera's network",
        ),
    };
    if views == own || views == Views::Unified {
        return Ok(());
    }
    Err(FramesError::Views {
        run: run.to_owned(),
        found: views,
        expected,
    })
}

/// Quality of a pose from 1 (ideal) to 3 (inadequate), as networks see it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PairPrediction {
    /// From the left camera's frame alone, unless one network judges both together.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left: Option<f64>,
    /// From the right camera's frame alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub right: Option<f64>,
    /// The mean of both, which is the paper's answer for a pose, or what the network says of both together.
    pub quality: f64,
    /// Medial rotation in degrees that would bring the limb into its best pose, laterally where negative: from networks that predict
    /// it, the mean of both.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub correction_deg: Option<f64>,
}

/// The networks that judge the frames of both cameras.
#[derive(Debug)]
pub struct PairPredictor {
    networks: Networks,
    cameras: [Camera; 2],
    /// Left limbs are shown as right ones, and the frames show a left one: the left camera's frame is that of the right input.
    mirrored: bool,
}

#[derive(Debug)]
enum Networks {
    /// One for each camera; their outputs are averaged.
    Separate([Trained; 2]),
    /// One that takes both images.
    Joint(Trained),
}

#[derive(Debug)]
struct Trained {
    network: InferenceNetwork,
    side: usize,
}

impl PairPredictor {
    /// The networks in the folders of finished trainings, and where each camera's frames show the joint: the left and the
    /// right camera's network, as in the paper, or one network of a unified view or of pairs. `side` is that of the limb in the frames;
    /// networks that were trained with `mirror` need it.
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
        let device = device.open().map_err(TrainError::from)?;
        let trained = |run: &Path| -> Result<_, TrainError> {
            let (config, network) = trained(run)?;
            Ok((config, InferenceNetwork::new(&network.to_device(&device)?)?))
        };
        let (config, network) = trained(left)?;
        let mirror = config.mirror;
        let of = |config: &TrainConfig, network| Trained {
            network,
            side: config.side,
        };
        let networks = match right {
            None => match config.views {
                Views::Pairs => Networks::Joint(of(&config, network)),
                Views::Unified => {
                    Networks::Separate([of(&config, network.clone()), of(&config, network)])
                }
                found => {
                    return Err(FramesError::Views {
                        run: left.to_owned(),
                        found,
                        expected: "\"unified\" or \"pairs\" for a network that stands alone",
                    });
                }
            },
            Some(right) => {
                of_camera(left, config.views, View::Left)?;
                let of_left = of(&config, network);
                let (config, network) = trained(right)?;
                of_camera(right, config.views, View::Right)?;
                if config.mirror != mirror {
                    return Err(FramesError::Mirror {
                        runs: [left.to_owned(), right.to_owned()],
                        left: mirror,
                    });
                }
                Networks::Separate([of_left, of(&config, network)])
            }
        };
        let run = left.to_owned();
        let mirrored = match (mirror, side) {
            (true, None) => return Err(FramesError::Side { run }),
            (true, Some(side)) => side == Side::Left,
            (false, _) => false,
        };
        let [left, right] = regions;
        Ok(Self {
            networks,
            cameras: [
                Camera::new(View::Left, left, mirrored),
                Camera::new(View::Right, right, mirrored),
            ],
            mirrored,
        })
    }

    /// Reads the left and the right camera's frame and judges them, each on a thread of its own where there are two.
    ///
    /// # Errors
    /// [`FramesError`] naming the frame that cannot be used.
    pub fn predict(&self, frames: [&Path; 2]) -> Result<PairPrediction, FramesError> {
        let image = |camera: usize, of: &Trained| {
            self.cameras[camera].image(frames[camera], of.side, of.network.device())
        };
        // The cameras whose frames are those of the left and of the right input.
        let [first, second] = if self.mirrored { [1, 0] } else { [0, 1] };
        match &self.networks {
            Networks::Separate([of_first, of_second]) => {
                let (one, other) = rayon::join(
                    || of_first.prediction(&[image(first, of_first)?]),
                    || of_second.prediction(&[image(second, of_second)?]),
                );
                let (one, other) = (one?, other?);
                let mut of_camera = [0.0; 2];
                of_camera[first] = one.quality;
                of_camera[second] = other.quality;
                let [left, right] = of_camera;
                let corrections = one.correction_deg.zip(other.correction_deg);
                Ok(PairPrediction {
                    left: Some(left),
                    right: Some(right),
                    quality: (left + right) / 2.0,
                    correction_deg: corrections.map(|(one, other)| (one + other) / 2.0),
                })
            }
            Networks::Joint(joint) => {
                let (one, other) = rayon::join(|| image(first, joint), || image(second, joint));
                let prediction = joint.prediction(&[one?, other?])?;
                Ok(PairPrediction {
                    left: None,
                    right: None,
                    quality: prediction.quality,
                    correction_deg: prediction.correction_deg,
                })
            }
        }
    }
}

impl Trained {
    /// What the network says of one image of each of its cameras.
    fn prediction(&self, images: &[Tensor]) -> Result<PosePrediction, TrainError> {
        Ok(PosePrediction::of(&self.network.forward(images)?)?[0])
    }
}

impl Camera {
    /// A frame as a tensor [1, 1, side, side] on a device.
    fn image(&self, frame: &Path, side: usize, device: &Device) -> Result<Tensor, TrainError> {
        let values = self.input(frame, side)?.into_values();
        Ok(Tensor::from_vec(values, (1, 1, side, side), device)?)
    }
}
