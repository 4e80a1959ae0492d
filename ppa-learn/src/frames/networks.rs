//! The networks for the frames of both cameras.

use std::path::{Path, PathBuf};

use candle_core::{Device, Tensor};
use ppa_dataset::layout::View;
use ppa_dataset::sha256_of_file;

use super::error::FramesError;
use crate::DeviceName;
use crate::confidence::Descriptors;
use crate::data::Views;
use crate::network::{InferenceNetwork, PosePrediction};
use crate::train::{TrainConfig, TrainError, trained};

/// Refuses the training run in the folder `run`, on images of `views`, if its network is not for images of `camera`.
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

/// Networks for the left and the right input: the images of the left and the right camera, exchanged for mirrored limbs.
#[derive(Debug)]
pub(super) enum Networks {
    /// One network for each camera; their outputs are averaged.
    Separate(Box<[Trained; 2]>),
    /// One network that takes both images.
    Joint(Box<Trained>),
}

/// The network of a training run.
#[derive(Debug, Clone)]
pub(super) struct Trained {
    /// Folder of the training run.
    run: PathBuf,
    pub config: TrainConfig,
    pub network: InferenceNetwork,
}

/// Output of the networks for one moment.
#[derive(Debug)]
pub(super) struct Moment {
    /// Prediction from both images.
    pub prediction: PosePrediction,
    /// Quality from each image alone, unless one network takes both.
    pub alone: Option<[f64; 2]>,
    /// Descriptors of each image.
    pub images: [Descriptors; 2],
}

impl Networks {
    /// Opens the folders of finished training runs: those of the left and the right camera, or one of a unified view or of pairs.
    pub fn open(
        left: &Path,
        right: Option<&Path>,
        device: DeviceName,
    ) -> Result<Self, FramesError> {
        let device = device.open().map_err(TrainError::from)?;
        let of_left = Trained::open(left, &device)?;
        let Some(right) = right else {
            return match of_left.config.views {
                Views::Pairs => Ok(Self::Joint(of_left.into())),
                Views::Unified => Ok(Self::Separate([of_left.clone(), of_left].into())),
                found => Err(FramesError::Views {
                    run: left.to_owned(),
                    found,
                    expected: "\"unified\" or \"pairs\" for a single network",
                }),
            };
        };
        of_camera(left, of_left.config.views, View::Left)?;
        let of_right = Trained::open(right, &device)?;
        of_camera(right, of_right.config.views, View::Right)?;
        let mirror = of_left.config.mirror;
        if of_right.config.mirror != mirror {
            return Err(FramesError::Mirror {
                runs: [left.to_owned(), right.to_owned()],
                left: mirror,
            });
        }
        Ok(Self::Separate([of_left, of_right].into()))
    }

    /// Returns the network of each input.
    pub fn of_inputs(&self) -> [&Trained; 2] {
        match self {
            Self::Separate(networks) => networks.each_ref(),
            Self::Joint(network) => [network, network],
        }
    }

    /// Evaluates moments, from each input's images [moments, 1, side, side].
    pub fn moments(&self, images: &[Tensor; 2]) -> Result<Vec<Moment>, TrainError> {
        let moment = |prediction, alone, images| Moment {
            prediction,
            alone,
            images,
        };
        match self {
            Self::Separate(networks) => {
                let [of_left, of_right] = &**networks;
                let (left, right) = rayon::join(
                    || of_left.outputs(&images[..1]),
                    || of_right.outputs(&images[1..]),
                );
                let ((lefts, mut of_lefts), (rights, mut of_rights)) = (left?, right?);
                let images = of_lefts.remove(0).into_iter().zip(of_rights.remove(0));
                let moments = lefts.into_iter().zip(rights).zip(images);
                let moment = |((left, right), (of_left, of_right)): (
                    (PosePrediction, PosePrediction),
                    _,
                )| {
                    let alone = Some([left.quality, right.quality]);
                    moment(mean(left, right), alone, [of_left, of_right])
                };
                Ok(moments.map(moment).collect())
            }
            Self::Joint(network) => {
                let (predictions, mut images) = network.outputs(images)?;
                let (of_rights, of_lefts) = (images.remove(1), images.remove(0));
                let images = of_lefts.into_iter().zip(of_rights);
                let moments = predictions.into_iter().zip(images);
                Ok(moments
                    .map(|(prediction, (left, right))| moment(prediction, None, [left, right]))
                    .collect())
            }
        }
    }
}

impl Trained {
    fn open(run: &Path, device: &Device) -> Result<Self, TrainError> {
        let (config, network) = trained(run)?;
        let network = InferenceNetwork::new(&network.to_device(device)?)?;
        Ok(Self {
            run: run.to_owned(),
            config,
            network,
        })
    }

    /// Returns the SHA-256 of the weight file.
    pub fn sha256(&self) -> Result<String, TrainError> {
        let weights = self.run.join("weights.safetensors");
        Ok(sha256_of_file(&weights)?)
    }

    /// Returns the network's predictions for moments, and descriptors of each camera's images.
    pub fn outputs(&self, images: &[Tensor]) -> Result<Outputs, TrainError> {
        let features = self.network.features(images)?;
        let predictions = PosePrediction::of(&self.network.classify(&features)?)?;
        let cameras = features.iter().zip(images);
        let descriptors = cameras.map(|(features, images)| {
            let inputs: Vec<Vec<f32>> = images.flatten_from(1)?.to_vec2()?;
            let features: Vec<Vec<f32>> = features.to_vec2()?;
            let all = features.iter().zip(&inputs);
            let side = self.config.side;
            Ok(all
                .map(|(of, input)| Descriptors::new(of, input, side))
                .collect())
        });
        let descriptors = descriptors.collect::<Result<_, candle_core::Error>>()?;
        Ok((predictions, descriptors))
    }
}

/// Prediction of each moment, and descriptors by camera and moment.
type Outputs = (Vec<PosePrediction>, Vec<Vec<Descriptors>>);

/// Returns the paper's prediction for a pose: the mean of both cameras.
fn mean(left: PosePrediction, right: PosePrediction) -> PosePrediction {
    let corrections = left.correction_deg.zip(right.correction_deg);
    PosePrediction {
        quality: (left.quality + right.quality) / 2.0,
        correction_deg: corrections.map(|(left, right)| (left + right) / 2.0),
    }
}
