//! Settings of a training run.

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

/// Complete configuration of a training run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainConfig {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Cameras whose images the network gets.
    pub views: Views,
    /// Show left limbs as right ones, in training and in prediction: images mirrored left to right, cameras exchanged. Training runs of
    /// earlier versions, whose configurations lack the key, show limbs as they are.
    #[serde(default)]
    pub mirror: bool,
    /// Columns and rows of the network's input.
    pub side: usize,
    /// Number of samples per step.
    pub batch_size: NonZeroUsize,
    /// Number of steps, as `step_counting` counts them.
    pub steps: u64,
    /// Unit of `steps`.
    pub step_counting: StepCounting,
    /// Highest learning rate, that of the first step after the warm-up.
    pub learning_rate: f64,
    /// Decay of the learning rate after that.
    #[serde(default)]
    pub rate_schedule: RateSchedule,
    /// Number of optimiser steps over which the learning rate rises linearly to the highest one.
    #[serde(default)]
    pub warm_up_steps: u64,
    /// Decay per step of the exponential moving average of the weights, which is evaluated and saved instead of the weights; 0 for none. A
    /// decay above 0 requires `recompute_statistics`.
    #[serde(default)]
    pub weight_average: f64,
    /// Number of unaugmented training batches whose mean statistics are used for normalisation in each evaluation and in the saved weights;
    /// 0 keeps the running statistics of training. Linear probing keeps those of `start`, with which its features are computed.
    #[serde(default)]
    pub recompute_statistics: u64,
    /// Weight of the mean squared error of the correction in the loss, in units of 30°; the network then has a second output, the
    /// medial rotation from a pose to the best one of its limb. 0 for the paper's network, which has none.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub correction_weight: f64,
    /// Draw rare labels as often as others; otherwise, draw every sample equally often.
    #[serde(default = "yes")]
    pub balanced: bool,
    /// Number of frames used per recorded pose.
    pub frames_per_pose: usize,
    /// Number of threads that load images.
    pub workers: NonZeroUsize,
    /// Device on which the network computes.
    #[serde(default)]
    pub device: DeviceName,
    /// Memory limit for prepared images, in MB (10⁶ bytes).
    pub keep_mb: usize,
    /// Number of steps between two rows of the log.
    pub log_every: NonZeroUsize,
    /// Number of steps between two checkpoints.
    pub checkpoint_every: NonZeroUsize,
    /// Initial weights, relative to the folder of the configuration: safetensors or `.pth`, with torchvision's or timm's names. Random if
    /// left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<PathBuf>,
    /// How a first convolution of several channels in `start` is converted.
    pub first_convolution: FirstConvolution,
    /// Layers that are trained.
    pub layers: Layers,
    /// Dropout and initial values of the network.
    pub network: NetworkConfig,
    /// How `views = "pairs"` joins the images of both cameras.
    pub fusion: Fusion,
    /// Augmentation of training images.
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

/// Layers that are trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Layers {
    /// All layers.
    All,
    /// The last layer, on features of images that are not augmented: linear probing.
    Last,
}

/// Dropout and initial values of a network.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkConfig {
    /// Probability that a feature is dropped before the last layer.
    pub dropout: f32,
    /// Probability that the last block drops its residual branch.
    pub stochastic_depth: f32,
    /// Initial values of the last layer, unless `start` contains one for a single output.
    pub last_layer: LastLayer,
}

/// Initial values of the last layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LastLayer {
    /// torchvision's, as used by the paper's authors: weights uniform in ±1 / sqrt(outputs) = ±1, bias 0. Outputs start with errors of
    /// about 10 and take a thousand steps of 10⁻³ to reach the magnitude of labels.
    Torchvision,
    /// Weights 0 and bias 2: outputs start in the middle of the labels, 1 to 3.
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
    /// Body shapes of rotated poses; all of them if left out. Recorded poses have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shapes: Option<Vec<BodyShape>>,
    /// Use every n-th angle of the rotated poses of each limb, from the smallest; all of them if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub every_pose: Option<NonZeroUsize>,
    /// NAME of the label file `labels.NAME.json`; `labels.json` if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub labels: Option<LabelName>,
}

impl TrainConfig {
    /// Returns the targets that the network predicts.
    pub fn targets(&self) -> Targets {
        match self.correction_weight > 0.0 {
            true => Targets::QualityAndCorrection,
            false => Targets::Quality,
        }
    }

    /// Returns the learning rates of all steps.
    pub fn schedule(&self) -> Schedule {
        Schedule {
            counting: self.step_counting,
            count: self.steps,
            first_rate: self.learning_rate,
            shape: self.rate_schedule,
            warm_up: self.warm_up_steps,
        }
    }

    /// Returns the selection of samples of a source.
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

    /// Returns the metadata of weight files.
    pub fn weights_metadata(&self) -> WeightsMetadata {
        WeightsMetadata::new(self.mirror, self.targets())
    }

    /// Returns the settings that must be equal to resume a training run; threads, device, memory and intervals may change.
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
