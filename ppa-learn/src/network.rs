//! EfficientNet-B0 (Tan and Le 2019, arXiv:1905.11946) with one input channel and one output value, built as in torchvision.

mod architecture;
mod backward;
mod error;
mod folded;
mod forward;
mod fusion;
#[cfg(test)]
mod gradient_tests;
mod inference;
mod inference_network;
mod initialise;
mod layers;
mod norm;
mod on_device;
#[cfg(test)]
mod on_device_tests;
mod operation;
mod quality;
#[cfg(test)]
mod reference;
mod squeeze;
mod tape;

use candle_core::{Device, Tensor, Var};

pub use architecture::Entry;
pub(crate) use architecture::{
    Architecture, Block, ConvKind, ConvPlace, FEATURES, LinearPlace, SqueezePlace,
};
pub use error::NetworkError;
use folded::Folded;
pub(crate) use fusion::LateFusion;
pub use fusion::{Fusion, FusionKind};
pub use inference_network::InferenceNetwork;
pub(crate) use layers::Layers;
pub(crate) use norm::running;
use operation::Backbone;
pub(crate) use quality::CAMERA_PREFIXES;
pub use quality::{CORRECTION_UNIT_DEG, Place, PosePrediction, QualityNetwork, Targets};

use crate::kernels::buffer::Pool;
use crate::random::{Purpose, stream};

/// Dropout and stochastic depth in training.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Probability that a feature is dropped before the last layer.
    pub dropout: f32,
    /// Probability that the last block drops its residual branch for an image; block i of 16 has i/16 of this probability.
    pub stochastic_depth: f32,
}

impl Default for Options {
    /// The values of the paper's authors: 0.5 and 0.2.
    fn default() -> Self {
        Self {
            dropout: 0.5,
            stochastic_depth: 0.2,
        }
    }
}

/// Purpose of a forward pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Normalises by the batch, updates the running statistics, and applies dropout determined by (seed, step).
    ///
    /// A network that is run twice in one step needs two different numbers for independent dropout.
    Train {
        /// Index of the random numbers.
        step: u64,
    },
    /// Normalises by the batch, without dropout. The running statistics become the mean of those of the batches so far, whatever
    /// they were before the first one.
    Statistics {
        /// Number of batches so far.
        batches: u64,
    },
    /// Normalises by the running statistics, without dropout.
    Eval,
}

impl Mode {
    /// Returns the weight of a batch in the update of the running statistics.
    fn momentum(self) -> f64 {
        match self {
            Self::Train { .. } => norm::MOMENTUM,
            Self::Statistics { batches } => 1.0 / (batches + 1) as f64,
            Self::Eval => 0.0,
        }
    }

    /// Returns the step whose random numbers determine dropout and stochastic depth; `None` if neither applies.
    fn dropout_step(self) -> Option<u64> {
        match self {
            Self::Train { step } => Some(step),
            Self::Statistics { .. } | Self::Eval => None,
        }
    }
}

/// A tensor of the network with torchvision's name.
#[derive(Debug, Clone)]
pub struct Named {
    /// torchvision's name, such as `features.0.0.weight`.
    pub name: String,
    /// Copy of its current values, in torchvision's shape.
    pub tensor: Tensor,
}

/// EfficientNet-B0 with 4,008,253 parameters for one output, all f32; created on the CPU, see [`EfficientNetB0::to_device`].
///
/// The parameters are two flat variables, one of the backbone and one of the classifier, so that the backbone is a single
/// operation in candle: `loss.backward()` gives one gradient for each of the two. [`EfficientNetB0::parameters`] names their parts.
#[derive(Debug, Clone)]
pub struct EfficientNetB0 {
    architecture: std::sync::Arc<Architecture>,
    backbone: Var,
    classifier: Var,
    statistics: Var,
    pool: Pool,
    /// Prearranged convolutions of a network whose variables do not change.
    folded: Option<std::sync::Arc<Folded>>,
    seed: u64,
    options: Options,
}

impl EfficientNetB0 {
    /// Makes a network with torchvision's initial values: convolutions normal with variance 2 / fan-out, the last layer uniform
    /// in ±1 / sqrt(outputs), normalisation 1 and 0. `seed` determines them and the dropout in training.
    ///
    /// # Errors
    /// If candle cannot make the variables.
    pub fn new(seed: u64, options: Options) -> Result<Self, NetworkError> {
        Self::with_outputs(seed, options, 1)
    }

    /// The same as [`EfficientNetB0::new`], with `outputs` values for each image.
    ///
    /// # Errors
    /// If candle cannot make the variables.
    pub(crate) fn with_outputs(
        seed: u64,
        options: Options,
        outputs: usize,
    ) -> Result<Self, NetworkError> {
        let architecture = Architecture::new(outputs, options.stochastic_depth);
        let (backbone, classifier) = initialise::parameters(&architecture, seed);
        let statistics = initialise::statistics(&architecture);
        Ok(Self {
            backbone: variable(backbone)?,
            classifier: variable(classifier)?,
            statistics: variable(statistics)?,
            architecture: std::sync::Arc::new(architecture),
            pool: Pool::default(),
            folded: None,
            seed,
            options,
        })
    }

    /// Computes one value for each image [images, 1], from images [images, 1, height, width] in f32, of any height and width.
    ///
    /// # Errors
    /// If the images have another shape, or if training would normalise by a single value for each channel.
    pub fn forward(&self, images: &Tensor, mode: Mode) -> Result<Tensor, NetworkError> {
        self.classify(&self.features(images, mode)?, mode)
    }

    /// Computes the features [images, 1280], the input of the last layer.
    ///
    /// # Errors
    /// The same as [`EfficientNetB0::forward`].
    pub fn features(&self, images: &Tensor, mode: Mode) -> Result<Tensor, NetworkError> {
        let &[count, 1, height, width] = images.dims() else {
            return Err(NetworkError::Shape {
                found: images.dims().to_vec(),
            });
        };
        if images.elem_count() == 0 {
            return Err(NetworkError::Shape {
                found: images.dims().to_vec(),
            });
        }
        if mode != Mode::Eval && count * height.div_ceil(32) * width.div_ceil(32) == 1 {
            return Err(NetworkError::OneValue {
                images: count,
                height,
                width,
            });
        }
        // The SIMD kernels run only on the CPU.
        if !self.device().is_cpu() {
            return Ok(on_device::features(self, images, mode)?);
        }
        let operation = Backbone::new(self, mode);
        Ok(images.contiguous()?.apply_op2(&self.backbone, operation)?)
    }

    /// Applies the last layer to features [images, 1280], in training after dropout.
    ///
    /// # Errors
    /// If the features have another shape.
    pub fn classify(&self, features: &Tensor, mode: Mode) -> Result<Tensor, NetworkError> {
        let [weight, bias] = &self.architecture.classifier[..] else {
            unreachable!("a classifier has a weight and a bias")
        };
        let [weight, bias] = [weight, bias].map(|entry| entry.view(&self.classifier));
        let kept = match mode.dropout_step() {
            Some(step) if 0.0 < self.options.dropout => {
                let mut random = stream(self.seed, Purpose::Dropout, 2 * step + 1);
                let gains =
                    initialise::gains(&mut random, features.elem_count(), self.options.dropout);
                (features * Tensor::from_vec(gains, features.shape(), features.device())?)?
            }
            _ => features.clone(),
        };
        Ok(kept.matmul(&weight?.t()?)?.broadcast_add(&bias?)?)
    }

    pub(crate) fn architecture(&self) -> &Architecture {
        &self.architecture
    }

    /// Returns the device on which the network computes and its images must be.
    pub fn device(&self) -> &Device {
        self.backbone.device()
    }

    /// Returns a copy on another device.
    ///
    /// # Errors
    /// If candle cannot copy.
    pub fn to_device(&self, device: &Device) -> Result<Self, NetworkError> {
        Ok(Self {
            architecture: self.architecture.clone(),
            backbone: on_device(&self.backbone, device)?,
            classifier: on_device(&self.classifier, device)?,
            statistics: on_device(&self.statistics, device)?,
            pool: Pool::default(),
            folded: None,
            ..*self
        })
    }

    /// Returns the two flat variables that training changes: the backbone's and the classifier's.
    pub fn variables(&self) -> [&Var; 2] {
        [&self.backbone, &self.classifier]
    }

    /// Returns the running means and variances of all normalisations, one flat variable that training updates without a gradient.
    pub fn statistics_variable(&self) -> &Var {
        &self.statistics
    }

    /// Returns the position of each parameter in [`EfficientNetB0::variables`] (first index), in torchvision's order.
    pub fn layout(&self) -> impl Iterator<Item = (usize, &Entry)> {
        let backbone = self.architecture.backbone.iter().map(|entry| (0, entry));
        backbone.chain(self.architecture.classifier.iter().map(|entry| (1, entry)))
    }

    /// Returns the position of each running mean and variance in [`EfficientNetB0::statistics_variable`].
    pub fn statistics_layout(&self) -> impl Iterator<Item = &Entry> {
        self.architecture.statistics.iter()
    }

    /// Returns every parameter by name.
    ///
    /// # Errors
    /// If candle cannot copy.
    pub fn parameters(&self) -> Result<Vec<Named>, NetworkError> {
        self.named([self.backbone.as_tensor(), self.classifier.as_tensor()])
    }

    /// Returns the named parts of two flat tensors laid out as [`EfficientNetB0::variables`], such as their gradients.
    ///
    /// # Errors
    /// If the tensors have other lengths than the variables.
    pub fn named(&self, flat: [&Tensor; 2]) -> Result<Vec<Named>, NetworkError> {
        self.layout()
            .map(|(variable, entry)| entry.of(flat[variable]))
            .collect()
    }

    /// Returns the running means and variances by name.
    ///
    /// # Errors
    /// If candle cannot copy.
    pub fn statistics(&self) -> Result<Vec<Named>, NetworkError> {
        self.architecture
            .statistics
            .iter()
            .map(|entry| entry.of(&self.statistics))
            .collect()
    }
}

pub(crate) fn variable(values: Vec<f32>) -> Result<Var, NetworkError> {
    let tensor = Tensor::new(values, &Device::Cpu)?;
    Ok(Var::from_tensor(&tensor)?)
}

/// Returns a copy of a variable on a device.
fn on_device(variable: &Var, device: &Device) -> Result<Var, NetworkError> {
    // `from_tensor` would not copy a tensor that is already a variable.
    let values = variable.as_detached_tensor().to_device(device)?;
    Ok(Var::from_tensor(&values)?)
}
