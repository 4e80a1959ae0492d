//! Presets of training configurations.

use std::num::NonZeroUsize;

use super::config::{LastLayer, Layers, NetworkConfig, TrainConfig};
use super::schedule::{RateSchedule, StepCounting};
use crate::DeviceName;
use crate::data::{Augmentation, FRAMES_PER_POSE, Views};
use crate::network::{Fusion, Options};
use crate::weights::FirstConvolution;

impl TrainConfig {
    /// Returns the paper's configuration, without data. Unlike in the paper, left limbs are shown as right ones: `mirror = false`
    /// leaves them as they are.
    pub fn paper() -> Self {
        let number = |n| NonZeroUsize::new(n).expect("the numbers below are not 0");
        let options = Options::default();
        Self {
            seed: 1,
            views: Views::Left,
            mirror: true,
            side: 336,
            batch_size: number(16),
            steps: 200_000,
            step_counting: StepCounting::Optimiser,
            learning_rate: 1e-3,
            rate_schedule: RateSchedule::Drops,
            warm_up_steps: 0,
            weight_average: 0.0,
            recompute_statistics: 0,
            correction_weight: 0.0,
            balanced: true,
            frames_per_pose: FRAMES_PER_POSE,
            workers: number(2),
            device: DeviceName::Cpu,
            keep_mb: 2000,
            log_every: number(50),
            checkpoint_every: number(1000),
            start: None,
            first_convolution: FirstConvolution::default(),
            layers: Layers::All,
            network: NetworkConfig {
                dropout: options.dropout,
                stochastic_depth: options.stochastic_depth,
                last_layer: LastLayer::Torchvision,
            },
            fusion: Fusion::default(),
            augmentation: Augmentation::default(),
            training: Vec::new(),
            evaluation: Vec::new(),
        }
    }

    /// Returns a configuration of 3000 steps of 32 images of 48 x 48 pixels: about 4 minutes of CPU time on an AMD EPYC.
    ///
    /// The differences from [`quick`](Self::quick) are:
    ///
    /// * Steps of 32 images instead of 16: normalisation by the batch mixes less of other poses into a prediction, and the learning rate
    ///   can be twice as high.
    /// * The learning rate rises over 100 steps, because Adam's first steps have full length for any gradient, and falls to 0 along a
    ///   cosine.
    /// * An average of the weights is evaluated and saved, because the weights of single steps fluctuate.
    /// * Running statistics are the mean of 16 batches, 512 images. Those of training lag behind its weights: in the first
    ///   hundred steps predictions are then nearly constant (`early_answers_are_nearly_constant_with_lagging_ones`).
    /// * Samples are drawn as often as they occur in the data, because the mean absolute error weights them in this way.
    pub fn standard() -> Self {
        let quick = Self::quick();
        Self {
            steps: 3000,
            batch_size: NonZeroUsize::MIN.saturating_add(31),
            learning_rate: 2e-3,
            rate_schedule: RateSchedule::Cosine,
            warm_up_steps: 100,
            weight_average: 0.995,
            recompute_statistics: 16,
            balanced: false,
            log_every: NonZeroUsize::MIN.saturating_add(49),
            checkpoint_every: NonZeroUsize::MIN.saturating_add(249),
            ..quick
        }
    }

    /// Returns the paper's configuration with images of 48 x 48 pixels and 400 steps, which takes minutes on two cores.
    ///
    /// It also omits what does not work with only 400 steps, in PyTorch as well:
    ///
    /// * The last layer starts in the middle of the labels. From torchvision's initial values this alone would take a thousand steps.
    /// * There is no dropout, and images are neither mirrored nor rotated.
    /// * Images are not blurred: a box of 3 to 7 of 48 pixels would be one of 21 to 49 of the paper's 336. As the paper's boxes average
    ///   its noise over 9 to 49 pixels, noise that is not blurred has a 25th of the variance.
    pub fn quick() -> Self {
        let paper = Self::paper();
        Self {
            side: 48,
            steps: 400,
            log_every: NonZeroUsize::MIN.saturating_add(9),
            checkpoint_every: NonZeroUsize::MIN.saturating_add(99),
            network: NetworkConfig {
                dropout: 0.0,
                stochastic_depth: 0.0,
                last_layer: LastLayer::Middle,
            },
            augmentation: Augmentation {
                flip_probability: 0.0,
                rotate_probability: 0.0,
                noise_max_variance: 4e-5,
                blur_probability: 0.0,
                ..paper.augmentation
            },
            ..paper
        }
    }
}
