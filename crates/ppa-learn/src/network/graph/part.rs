//! Blocks of the network as operations of candle, on channels-last images [images, height, width, channels].

use std::ops::Range;

use candle_core::{Result, Tensor};
use candle_nn::ops::sigmoid;

use super::super::architecture::{Block, ConvPlace, NormPlace, SqueezePlace};
use super::super::norm::EPSILON;
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
            // With one channel in, a convolution is a pointwise one of what lies under its window.
            true => self.pointwise(&block.expand, &Tensor::cat(&taps(input, STEM)?, 3)?)?,
            false => self.pointwise(&block.expand, input)?,
        };
        let x = self.normalise(&block.expand.norm, &x)?.silu()?;
        let x = self.depthwise(&block.depthwise, block.window, &x)?;
        let x = self.normalise(&block.depthwise.norm, &x)?.silu()?;
        let x = x.broadcast_mul(&self.gates(&block.squeeze, &x)?)?;
        let x = self.pointwise(&block.project, &x)?;
        let x = self.normalise(&block.project.norm, &x)?;
        match (block.residual, gains) {
            (true, Some(gains)) => x.broadcast_mul(gains)? + input,
            (true, None) => x + input,
            (false, _) => Ok(x),
        }
    }

    /// Features [images, features] of the last block's output.
    pub fn head(&mut self, head: &ConvPlace, input: &Tensor) -> Result<Tensor> {
        let x = self.pointwise(head, input)?;
        self.normalise(&head.norm, &x)?.silu()?.mean((1, 2))
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

    /// The sum over the window of shifted images times one weight for each channel: candle's own convolution of groups
    /// would take every channel by itself.
    fn depthwise(&self, place: &ConvPlace, window: Window, x: &Tensor) -> Result<Tensor> {
        let weight = self.values(&place.weight)?.reshape((place.channels, ()))?;
        let weights = weight.t()?.contiguous()?;
        let mut sum: Option<Tensor> = None;
        for (index, tap) in taps(x, window)?.iter().enumerate() {
            let product = tap.broadcast_mul(&weights.get(index)?)?;
            sum = Some(match sum {
                Some(sum) => (sum + product)?,
                None => product,
            });
        }
        Ok(sum.expect("a window is not empty"))
    }

    fn normalise(&mut self, place: &NormPlace, x: &Tensor) -> Result<Tensor> {
        let (centred, variance) = match &mut *self.moments {
            Moments::Running(statistics) => {
                let of = |range: &Range<usize>| statistics.narrow(0, range.start, range.len());
                (x.broadcast_sub(&of(&place.mean)?)?, of(&place.variance)?)
            }
            Moments::Batch(found) => {
                let count = x.dims()[..3].iter().product::<usize>() as f64;
                let mean = self::mean(x)?;
                let centred = x.broadcast_sub(&mean)?;
                let variance = self::mean(&centred.sqr()?)?;
                found.push(mean.detach());
                found.push((variance.detach() * (count / (count - 1.0)))?);
                (centred, variance)
            }
        };
        let scale = (self.values(&place.weight)? / (variance + EPSILON)?.sqrt()?)?;
        centred
            .broadcast_mul(&scale)?
            .broadcast_add(&self.values(&place.bias)?)
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

/// Mean of each channel: over columns first, as long sums in f32 lose digits.
fn mean(x: &Tensor) -> Result<Tensor> {
    x.mean(2)?.mean(1)?.mean(0)
}

/// For each place of a window, row by row, what lies there under each pixel of the output: [images, height out, width out, channels].
fn taps(x: &Tensor, window: Window) -> Result<Vec<Tensor>> {
    let Window { kernel, stride } = window;
    let (images, height, width, channels) = x.dims4()?;
    let (rows, columns) = (window.output(height), window.output(width));
    // Row y * stride + k is row y + k / stride of every stride-th one from k % stride on.
    let steps = (kernel - 1) / stride;
    let padded = |x: &Tensor, dim: usize, len: usize| {
        let whole = (window.output(len) + steps) * stride;
        let padding = window.padding();
        x.pad_with_zeros(dim, padding, whole - len - padding)
    };
    let x = padded(&padded(x, 1, height)?, 2, width)?;
    let split = (
        images,
        rows + steps,
        stride,
        columns + steps,
        stride,
        channels,
    );
    let x = x.reshape(split)?;
    let mut phases = Vec::new();
    for y in 0..stride {
        for x_ in 0..stride {
            phases.push(
                x.narrow(2, y, 1)?
                    .narrow(4, x_, 1)?
                    .squeeze(4)?
                    .squeeze(2)?,
            );
        }
    }
    let mut taps = Vec::new();
    for place in 0..kernel * kernel {
        let (y, x) = (place / kernel, place % kernel);
        let phase = &phases[y % stride * stride + x % stride];
        taps.push(
            phase
                .narrow(1, y / stride, rows)?
                .narrow(2, x / stride, columns)?,
        );
    }
    Ok(taps)
}
