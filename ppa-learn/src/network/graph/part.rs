//! Blocks of the network as operations of candle and of ours, on channels-last images [images, height, width, channels].

use std::ops::Range;

use candle_core::{Result, Tensor};
use candle_nn::ops::sigmoid;

use super::super::architecture::{Block, ConvPlace, NormPlace, SqueezePlace};
use super::depthwise::depthwise;
use super::normalise::{by_batch, by_constants, moments};
use crate::kernels::depthwise::Window;

/// The first convolution.
const STEM: Window = Window {
    kernel: 3,
    stride: 2,
};

/// What normalisations normalise by.
pub enum Moments {
    /// The running statistics of the whole network.
    Running(Tensor),
    /// The batch, whose means and unbiased variances are added in the order of the running statistics.
    Batch(Vec<Tensor>),
}

/// A part of the network, whose parameters lie one after the other from `start` on.
pub struct Part<'a> {
    pub parameters: &'a Tensor,
    pub start: usize,
    pub moments: &'a mut Moments,
}

impl Part<'_> {
    /// Output of a block. `gains` [images, 1, 1, 1] are those of stochastic depth of a residual block in training.
    pub fn block(
        &mut self,
        block: &Block,
        first: bool,
        input: &Tensor,
        gains: Option<&Tensor>,
    ) -> Result<Tensor> {
        let x = match first {
            true => self.depthwise(&block.expand, STEM, input)?,
            false => self.pointwise(&block.expand, input)?,
        };
        let x = self.normalise(&block.expand.norm, &x, true)?;
        let x = self.depthwise(&block.depthwise, block.window, &x)?;
        let x = self.normalise(&block.depthwise.norm, &x, true)?;
        let x = x.broadcast_mul(&self.gates(&block.squeeze, &x)?)?;
        let x = self.pointwise(&block.project, &x)?;
        let x = self.normalise(&block.project.norm, &x, false)?;
        match (block.residual, gains) {
            (true, Some(gains)) => x.broadcast_mul(gains)? + input,
            (true, None) => x + input,
            (false, _) => Ok(x),
        }
    }

    /// Features [images, features] of the last block's output.
    pub fn head(&mut self, head: &ConvPlace, input: &Tensor) -> Result<Tensor> {
        let x = self.pointwise(head, input)?;
        self.normalise(&head.norm, &x, true)?.mean((1, 2))
    }

    fn values(&self, range: &Range<usize>) -> Result<Tensor> {
        self.parameters
            .narrow(0, range.start - self.start, range.len())
    }

    fn pointwise(&self, place: &ConvPlace, x: &Tensor) -> Result<Tensor> {
        let (images, height, width, _) = x.dims4()?;
        let weight = self.values(&place.weight)?.reshape((place.channels, ()))?;
        let out = x.flatten(0, 2)?.matmul(&weight.t()?)?;
        out.reshape((images, height, width, place.channels))
    }

    fn depthwise(&self, place: &ConvPlace, window: Window, x: &Tensor) -> Result<Tensor> {
        let weights = self.values(&place.weight)?;
        depthwise(x, &weights.reshape((place.channels, ()))?, window)
    }

    fn normalise(&mut self, place: &NormPlace, x: &Tensor, activated: bool) -> Result<Tensor> {
        // A bias lies behind its weight.
        let affine = self.values(&(place.weight.start..place.bias.end))?;
        let affine = affine.reshape((2, ()))?;
        match &mut *self.moments {
            Moments::Running(statistics) => {
                let of = |range: &Range<usize>| statistics.narrow(0, range.start, range.len());
                let (mean, variance) = (of(&place.mean)?, of(&place.variance)?);
                by_constants(x, &affine, (&mean, &variance), activated)
            }
            Moments::Batch(found) => {
                let count = x.dims()[..3].iter().product::<usize>() as f64;
                let (mean, variance) = moments(x)?;
                let x = by_batch(x, &affine, (&mean, &variance), activated)?;
                found.push(mean);
                found.push((variance * (count / (count - 1.0)))?);
                Ok(x)
            }
        }
    }

    /// Gates [images, 1, 1, channels] of a squeeze-and-excitation.
    fn gates(&self, place: &SqueezePlace, x: &Tensor) -> Result<Tensor> {
        let layer = |x: &Tensor, weight: &Range<usize>, bias: &Range<usize>| {
            let weight = self.values(weight)?.reshape((bias.len(), ()))?;
            x.matmul(&weight.t()?)?.broadcast_add(&self.values(bias)?)
        };
        let pooled = x.mean((1, 2))?;
        let hidden = layer(&pooled, &place.squeeze_weight, &place.squeeze_bias)?.silu()?;
        let gates = sigmoid(&layer(&hidden, &place.expand_weight, &place.expand_bias)?)?;
        gates.unsqueeze(1)?.unsqueeze(1)
    }
}
