//! The backbone on devices: products of matrices and small tensors by candle, passes over images by `device/kernels.cu`. For small images, launching
//! a kernel takes longer than its work, so each kernel does as much as one pass over an image allows.

mod backward;
mod depthwise;
mod forward;
#[cfg(test)]
mod gradient_tests;
mod normalise;
mod parameters;
mod reduce;
mod squeeze;

use std::sync::{Arc, Mutex, PoisonError};

use candle_core::backend::BackendStorage;
use candle_core::{
    CpuStorage, CudaStorage, CustomOp2, Error, Layout, Result, Shape, Storage, Tensor,
};

use super::architecture::{Architecture, Block};
use super::initialise::gains;
use super::layers::Layers;
use super::{EfficientNetB0, Mode};
use crate::device::launch::elsewhere;
use crate::random::{Purpose, stream};
use backward::Backward;
use forward::{Forward, Tape};
use parameters::Parameters;

/// Computes the features [images, 1280] of images [images, 1, height, width]; with a gradient if the pass normalises by the batch.
pub fn features(network: &EfficientNetB0, images: &Tensor, mode: Mode) -> Result<Tensor> {
    let (count, _, height, width) = images.dims4()?;
    let input = images.detach().reshape((count, height, width, 1))?;
    let architecture = &*network.architecture;
    let parameters = network.backbone.as_detached_tensor();
    let statistics = network.statistics.as_detached_tensor();
    let evaluates = mode == Mode::Eval;

    // Drawn block by block, as on the CPU.
    let step = mode.dropout_step();
    let mut random = step.map(|step| stream(network.seed, Purpose::Dropout, 2 * step));
    let mut draw = |block: &Block| match &mut random {
        Some(random) if block.residual => {
            let gains = gains(random, count, block.drop);
            Tensor::from_vec(gains, (count, 1), images.device()).map(Some)
        }
        _ => Ok(None),
    };
    let mut forward = Forward {
        parameters: Parameters(&parameters),
        running: evaluates.then_some(&statistics),
        gains: &mut draw,
        moments: Vec::new(),
        tape: Tape::default(),
    };
    let features = forward.features(architecture, input.contiguous()?)?;
    let Forward { moments, tape, .. } = forward;
    if evaluates {
        return Ok(features);
    }
    let found = Tensor::cat(&moments, 0)?;
    let momentum = mode.momentum();
    let moved = ((statistics * (1.0 - momentum))? + (found * momentum)?)?;
    network.statistics.set(&moved)?;
    let pass = Pass {
        architecture: Arc::clone(&network.architecture),
        features,
        tape: Mutex::new(Some(tape)),
    };
    images.apply_op2(&network.backbone, pass)
}

/// A completed pass, as one operation from (images, parameters) to features.
struct Pass {
    architecture: Arc<Architecture>,
    features: Tensor,
    tape: Mutex<Option<Tape>>,
}

impl CustomOp2 for Pass {
    fn name(&self) -> &'static str {
        "efficientnet-b0-on-device"
    }

    fn cpu_fwd(
        &self,
        _: &CpuStorage,
        _: &Layout,
        _: &CpuStorage,
        _: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let (storage, layout) = self.features.storage_and_layout();
        match &*storage {
            Storage::Cpu(features) => Ok((features.try_clone(layout)?, layout.shape().clone())),
            _ => Err(elsewhere()),
        }
    }

    fn cuda_fwd(
        &self,
        _: &CudaStorage,
        _: &Layout,
        _: &CudaStorage,
        _: &Layout,
    ) -> Result<(CudaStorage, Shape)> {
        let (storage, layout) = self.features.storage_and_layout();
        match &*storage {
            Storage::Cuda(features) => Ok((features.try_clone(layout)?, layout.shape().clone())),
            _ => Err(elsewhere()),
        }
    }

    /// The gradient of the parameters. Images have none.
    fn bwd(
        &self,
        _: &Tensor,
        parameters: &Tensor,
        _: &Tensor,
        of_features: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let tape = self.tape.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(tape) = { tape }.take() else {
            return Err(Error::msg("a pass of efficientnet-b0 has a gradient once").bt());
        };
        let of_features = of_features.detach().contiguous()?;
        let parameters = parameters.detach();
        let gradient = Backward::run(&self.architecture, &parameters, tape, &of_features)?;
        Ok((None, Some(gradient)))
    }
}
