//! Settings of a training.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use ppa_dataset::BodyShape;
use ppa_dataset::labels::LabelName;
use serde::{Deserialize, Serialize};

use crate::DeviceName;
use crate::data::{Augmentation, Selection, Views};
use crate::network::{Fusion, Targets};
use crate::weights::{FirstConvolution, WeightsMetadata};

use super::schedule::{RateSchedule, Schedule, StepCounting};

/// Complete configuration of a training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainConfig {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Which cameras' images the network gets.
    pub views: Views,
    /// Show left limbs as right ones, in training and in prediction: images mirrored left to right, cameras exchanged. Trainings of
    /// earlier programs, whose configurations lack the key, show limbs as they are.
    #[serde(default)]
    pub mirror: bool,
    /// Columns and rows that the network sees.
    pub side: usize,
    /// Samples of a step.
    pub batch_size: NonZeroUsize,
    /// Number of steps, as `step_counting` counts them.
    pub steps: u64,
    /// What `steps` counts.
    pub step_counting: StepCounting,
    /// The highest learning rate, that of the first step after the warm-up.
    pub learning_rate: f64,
    /// How the rate falls from there.
    #[serde(default)]
    pub rate_schedule: RateSchedule,
    /// Steps of the optimiser over which the learning rate rises evenly to the highest one.
    #[serde(default)]
    pub warm_up_steps: u64,
    /// Decay per step of the exponential moving average of the weights, which is evaluated and saved in place of the weights; 0 for none. A
    /// decay above 0 needs `recompute_statistics`.
    #[serde(default)]
    pub weight_average: f64,
    /// Number of unaugmented training batches whose mean statistics the normalisations use in each evaluation and in the saved weights; 0
    /// keeps the running statistics of training. Linear probing keeps those of `start`, to which its features belong.
    #[serde(default)]
    pub recompute_statistics: u64,
    /// Weight of the mean squared error of the correction in the loss, in units of 30°; the network then has a second output, the
    /// medial rotation from a pose to the best one of its limb. 0 for the paper's network, which has none.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub correction_weight: f64,
    /// Draw labels that are rare in the data as often as others; otherwise, draw every sample equally often.
    #[serde(default = "yes")]
    pub balanced: bool,
    /// Frames that are used of a recorded pose.
    pub frames_per_pose: usize,
    /// Threads that load images.
    pub workers: NonZeroUsize,
    /// Where the network computes.
    #[serde(default)]
    pub device: DeviceName,
    /// Prepared images that may stay in memory, in MB (10⁶ bytes).
    pub keep_mb: usize,
    /// Steps between two rows of the log.
    pub log_every: NonZeroUsize,
    /// Steps between two checkpoints.
    pub checkpoint_every: NonZeroUsize,
    /// Initial weights, relative to the folder of the configuration: safetensors or `.pth`, with torchvision's or timm's names. Random if
    /// left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<PathBuf>,
    /// How a first convolution of several channels in `start` is converted.
    pub first_convolution: FirstConvolution,
    /// Layers that are trained.
    pub layers: Layers,
    /// What training leaves out at random.
    pub network: NetworkConfig,
    /// How `views = "pairs"` joins the images of both cameras.
    pub fusion: Fusion,
    /// How training images are changed.
    pub augmentation: Augmentation,
    /// Persons to train on.
    pub training: Vec<Source>,
    /// Persons to evaluate on; none of them in training.
    #[serde(default)]
    pub evaluation: Vec<Source>,
}

fn yes() -> bool {
    true
}

fn is_zero(weight: &f64) -> bool {
    *weight == 0.0
}

/// Which layers are trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Layers {
    /// All.
    All,
    /// The last one, on features of images that are not augmented: linear probing.
    Last,
}

/// What training leaves out at random, and where it begins.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkConfig {
    /// Probability that a feature is left out before the last layer.
    pub dropout: f32,
    /// Probability that the last block leaves out its residual branch.
    pub stochastic_depth: f32,
    /// First values of the last layer, unless `start` holds one for a single output.
    pub last_layer: LastLayer,
}

/// First values of the last layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LastLayer {
    /// As torchvision draws them, which the paper's authors use: weights uniform in ±1 / sqrt(outputs) = ±1, bias 0. Outputs begin with
    /// errors of about 10 and take a thousand steps of 10⁻³ to reach the magnitude of labels.
    Torchvision,
    /// Weights 0 and bias 2: outputs begin in the middle of the labels, 1 to 3.
    Middle,
}

/// Persons of a dataset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// Folder of the dataset, relative to that of the configuration.
    pub dataset: PathBuf,
    /// Numbers of the persons; all of them if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub patients: Option<Vec<u32>>,
    /// Body shapes, of poses that were rotated; all of them if left out. Recorded poses have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shapes: Option<Vec<BodyShape>>,
    /// Use every n-th angle of the rotated poses of each limb, from the smallest; all of them if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub every_pose: Option<NonZeroUsize>,
    /// Name of the labels, those of `labels.NAME.json`; of `labels.json` if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub labels: Option<LabelName>,
}

impl TrainConfig {
    /// What the network predicts.
    pub fn targets(&self) -> Targets {
        match self.correction_weight > 0.0 {
            true => Targets::QualityAndCorrection,
            false => Targets::Quality,
        }
    }

    /// The rates of all steps.
    pub fn schedule(&self) -> Schedule {
        Schedule {
            counting: self.step_counting,
            count: self.steps,
            first_rate: self.learning_rate,
            shape: self.rate_schedule,
            warm_up: self.warm_up_steps,
        }
    }

    /// Which samples of a source are used.
    pub(super) fn selection<'a>(&self, source: &'a Source) -> Selection<'a> {
        Selection {
            patients: source.patients.as_deref(),
            shapes: source.shapes.as_deref(),
            every_pose: source.every_pose,
            labels: source.labels.as_ref(),
            unlabelled: false,
            views: self.views,
            frames_per_pose: self.frames_per_pose,
            mirror: self.mirror,
        }
    }

    /// What users of the weights must know beside their values, for the metadata of weight files.
    pub fn weights_metadata(&self) -> WeightsMetadata {
        WeightsMetadata::new(self.mirror, self.targets())
    }

    /// What must be equal for a training to continue; threads, device, memory and intervals may change.
    pub(crate) fn of_results(&self) -> Self {
        let paper = Self::paper();
        Self {
            workers: paper.workers,
            device: paper.device,
            keep_mb: paper.keep_mb,
            log_every: paper.log_every,
            checkpoint_every: paper.checkpoint_every,
            ..self.clone()
        }
    }
}
