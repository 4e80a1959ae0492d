//! A network with fixed parameters, prepared for repeated inference.

use std::sync::Arc;

use candle_core::{Device, Tensor};

use super::folded::Folded;
use super::{EfficientNetB0, Mode, NetworkError, QualityNetwork};

/// A copy of a [`QualityNetwork`] for inference alone, which is faster as its convolutions are laid out once and not for each batch.
///
/// It has no variables, and does not follow those of the network that it was made of.
#[derive(Debug, Clone)]
pub struct InferenceNetwork(QualityNetwork);

impl InferenceNetwork {
    /// Of a network as it is now, on its device.
    ///
    /// # Errors
    /// If candle cannot copy.
    pub fn new(network: &QualityNetwork) -> Result<Self, NetworkError> {
        let mut copy = network.to_device(network.device())?;
        copy.branches_mut().iter_mut().try_for_each(lay_out)?;
        Ok(Self(copy))
    }

    /// Values for each moment, as [`QualityNetwork::forward`] in [`Mode::Eval`].
    ///
    /// # Errors
    /// As [`QualityNetwork::forward`].
    pub fn forward(&self, images: &[Tensor]) -> Result<Tensor, NetworkError> {
        self.0.forward(images, Mode::Eval)
    }

    /// The features [moments, 1280] of each camera's images, as [`QualityNetwork::features`] in [`Mode::Eval`].
    ///
    /// # Errors
    /// As [`QualityNetwork::features`].
    pub fn features(&self, images: &[Tensor]) -> Result<Vec<Tensor>, NetworkError> {
        self.0.features(images, Mode::Eval)
    }

    /// The layers after the features, as [`QualityNetwork::classify`] in [`Mode::Eval`].
    ///
    /// # Errors
    /// As [`QualityNetwork::classify`].
    pub fn classify(&self, features: &[Tensor]) -> Result<Tensor, NetworkError> {
        self.0.classify(features, Mode::Eval)
    }

    /// Where it computes, and where its images have to be.
    pub fn device(&self) -> &Device {
        self.0.device()
    }
}

/// Lays out the convolutions of a network that nothing changes any more.
fn lay_out(network: &mut EfficientNetB0) -> Result<(), NetworkError> {
    // Our kernels know the CPU only.
    if network.device().is_cpu() {
        let parameters = network.backbone.to_vec1::<f32>()?;
        let statistics = network.statistics.to_vec1::<f32>()?;
        let (architecture, pool) = (&network.architecture, &network.pool);
        let folded = Folded::new(architecture, &parameters, &statistics, pool);
        network.folded = Some(Arc::new(folded));
    }
    Ok(())
}
