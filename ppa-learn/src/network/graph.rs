//! The backbone on devices: products of matrices and sums by candle, convolutions of windows and normalisation by `kernels.cu`.
//!
//! candle keeps every tensor that a gradient may need. A pass therefore keeps the inputs of the blocks only, and computes each
//! block again when its gradient is asked for (Chen et al. 2016, arXiv:1604.06174).

mod depthwise;
#[cfg(test)]
mod gradient_tests;
mod launch;
mod normalise;
mod part;

use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use candle_core::backend::BackendStorage;
use candle_core::{
    CpuStorage, CudaStorage, CustomOp2, Error, Layout, Result, Shape, Storage, Tensor, Var,
};

use super::architecture::{Architecture, Block, ConvPlace};
use super::initialise::gains;
use super::layers::Layers;
use super::{EfficientNetB0, Mode};
use crate::random::{Purpose, stream};
use launch::elsewhere;
use part::{Given, Part};

/// The features [images, 1280] of images [images, 1, height, width]; after a pass that normalises by the batch, with a gradient.
pub fn features(network: &EfficientNetB0, images: &Tensor, mode: Mode) -> Result<Tensor> {
    let (count, _, height, width) = images.dims4()?;
    let input = images.detach().reshape((count, height, width, 1))?;
    let architecture = &*network.architecture;
    let parameters = &network.backbone.as_detached_tensor();
    let statistics = network.statistics.as_detached_tensor();
    if mode == Mode::Eval {
        let mut none = |_: &Block| Ok(None);
        let mut part = Part::new(parameters, 0, Some(statistics), &mut none);
        return part.features(architecture, input);
    }

    // Drawn block by block as our kernels draw them.
    let step = mode.dropout_step();
    let mut random = step.map(|step| stream(network.seed, Purpose::Dropout, 2 * step));
    let mut draw = |block: &Block| match &mut random {
        Some(random) if block.residual => {
            let gains = gains(random, count, block.drop);
            Tensor::from_vec(gains, (count, 1, 1, 1), images.device()).map(Some)
        }
        _ => Ok(None),
    };
    let mut part = Part::new(parameters, 0, None, &mut draw);
    let features = part.features(architecture, input)?;
    let found = Tensor::cat(&part.moments, 0)?;
    let momentum = mode.momentum();
    let moved = ((statistics * (1.0 - momentum))? + (found * momentum)?)?;
    network.statistics.set(&moved)?;
    let pass = Pass {
        architecture: Arc::clone(&network.architecture),
        features: features.force_contiguous()?,
        tape: Mutex::new(Some(part.tape)),
    };
    images.apply_op2(&network.backbone, pass)
}

/// Where the parameters of a block or of the head lie, which is one after the other.
fn place(architecture: &Architecture, number: usize) -> Range<usize> {
    let of = |first: &ConvPlace, last: &ConvPlace| first.weight.start..last.norm.bias.end;
    match architecture.blocks.get(number) {
        Some(block) => of(&block.expand, &block.project),
        None => of(&architecture.head, &architecture.head),
    }
}

/// A pass that was made, as one operation from (images, parameters) to features.
struct Pass {
    architecture: Arc<Architecture>,
    features: Tensor,
    /// Of each block in turn and of the head.
    tape: Mutex<Option<Vec<Given>>>,
}

impl CustomOp2 for Pass {
    fn name(&self) -> &'static str {
        "efficientnet-b0-graph"
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

    /// The gradient of the parameters, each block computed again from its input. Images have none.
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
        let mut of_parameters = Vec::new();
        let mut of_output = of_features.detach();
        for (number, Given { input, gains }) in tape.into_iter().enumerate().rev() {
            let place = place(&self.architecture, number);
            let own = parameters.detach().narrow(0, place.start, place.len())?;
            let (own, input) = (Var::from_tensor(&own)?, Var::from_tensor(&input)?);
            let mut kept = |_: &Block| Ok(gains.clone());
            let mut part = Part::new(&own, place.start, None, &mut kept);
            let input = input.as_tensor();
            let output = match self.architecture.blocks.get(number) {
                Some(block) => part.block(block, input.clone()),
                None => part.head(&self.architecture.head, input.clone()),
            }?;
            let mut gradients = (output * of_output)?.sum_all()?.backward()?;
            let missing = || Error::msg("a block does not depend on its parameters").bt();
            of_parameters.push(gradients.remove(&own).ok_or_else(missing)?);
            match gradients.remove(input) {
                Some(of_input) => of_output = of_input,
                // Images have none.
                None => break,
            }
        }
        of_parameters.reverse();
        Ok((None, Some(Tensor::cat(&of_parameters, 0)?)))
    }
}
