//! A network with fixed parameters, prepared for repeated inference.

use std::sync::Arc;

use candle_core::{Device, Tensor};

use super::folded::Folded;
use super::{EfficientNetB0, Mode, NetworkError, QualityNetwork};

/// A copy of a [`QualityNetwork`] for inference only, which is faster because its convolutions are laid out once and not for each batch.
///
/// It has no variables, and does not follow later changes of the original network.
#[derive(Debug, Clone)]
pub struct InferenceNetwork(QualityNetwork);

impl InferenceNetwork {
    /// Copies a network in its current state, on its device.
    ///
    /// # Errors
    /// If candle cannot copy.
    pub fn new(network: &QualityNetwork) -> Result<Self, NetworkError> {
        let mut copy = network.to_device(network.device())?;
        copy.branches_mut().iter_mut().try_for_each(lay_out)?;
        Ok(Self(copy))
    }

    /// Computes the outputs for each moment, as [`QualityNetwork::forward`] in [`Mode::Eval`].
    ///
    /// # Errors
    /// The same as [`QualityNetwork::forward`].
    pub fn forward(&self, images: &[Tensor]) -> Result<Tensor, NetworkError> {
        self.0.forward(images, Mode::Eval)
    }

    /// Computes the features [moments, 1280] of each camera's images, as [`QualityNetwork::features`] in [`Mode::Eval`].
    ///
    /// # Errors
    /// The same as [`QualityNetwork::features`].
    pub fn features(&self, images: &[Tensor]) -> Result<Vec<Tensor>, NetworkError> {
        self.0.features(images, Mode::Eval)
    }

    /// Applies the layers after the features, as [`QualityNetwork::classify`] in [`Mode::Eval`].
    ///
    /// # Errors
    /// The same as [`QualityNetwork::classify`].
    pub fn classify(&self, features: &[Tensor]) -> Result<Tensor, NetworkError> {
        self.0.classify(features, Mode::Eval)
    }

    /// Returns the device on which the network computes and its images must be.
    pub fn device(&self) -> &Device {
        self.0.device()
    }
}

/// Lays out the convolutions of a network that no longer changes.
fn lay_out(network: &mut EfficientNetB0) -> Result<(), NetworkError> {
    // The SIMD kernels run only on the CPU.
    if network.device().is_cpu() {
        let parameters = network.backbone.to_vec1::<f32>()?;
        let statistics = network.statistics.to_vec1::<f32>()?;
        let (architecture, pool) = (&network.architecture, &network.pool);
        let folded = Folded::new(architecture, &parameters, &statistics, pool);
        network.folded = Some(Arc::new(folded));
    }
    Ok(())
}
