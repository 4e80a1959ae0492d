//! Blocks of the network as operations of candle and of ours, on channels-last images [images, height, width, channels].

use std::ops::Range;

use candle_core::{Error, Result, Tensor};
use candle_nn::ops::sigmoid;

use super::super::architecture::{Block, ConvKind, ConvPlace, LinearPlace, NormPlace};
use super::super::layers::Layers;
use super::depthwise::depthwise;
use super::normalise::{Moments, by_batch, by_constants};

/// A part of the network, whose parameters lie one after the other from `start` on.
pub struct Part<'a> {
    parameters: &'a Tensor,
    start: usize,
    /// The running statistics of the whole network, which normalisations take in evaluation. In training they take the batch.
    running: Option<Tensor>,
    /// Gains [images, 1, 1, 1] of stochastic depth of a residual block in training.
    gains: &'a mut dyn FnMut(&Block) -> Result<Option<Tensor>>,
    /// Means and unbiased variances of the batch, in the order of the running statistics.
    pub moments: Vec<Tensor>,
    /// What each block in turn and the head were given in training.
    pub tape: Vec<Given>,
}

/// What a block, or the head, was given; the head has no gains.
pub struct Given {
    pub input: Tensor,
    pub gains: Option<Tensor>,
}

impl Layers for Part<'_> {
    type Image = Tensor;
    type Expanded = Tensor;
    type Filtered = Tensor;
    /// [images, 1, 1, channels]
    type Gate = Tensor;
    type Features = Tensor;
    type Error = Error;

    fn expand(&mut self, block: &Block, x: &Tensor) -> Result<Tensor> {
        self.conv(&block.expand, x, true)
    }

    fn depthwise(&mut self, block: &Block, x: Tensor) -> Result<Tensor> {
        self.conv(&block.depthwise, &x, true)
    }

    fn squeeze(&mut self, block: &Block, x: &Tensor) -> Result<Tensor> {
        let pooled = x.mean((1, 2))?;
        let hidden = self.linear(&block.squeeze.squeeze, &pooled)?.silu()?;
        let gates = sigmoid(&self.linear(&block.squeeze.expand, &hidden)?)?;
        gates.unsqueeze(1)?.unsqueeze(1)
    }

    fn project(
        &mut self,
        block: &Block,
        x: Tensor,
        gates: Tensor,
        input: Tensor,
    ) -> Result<Tensor> {
        let x = x.broadcast_mul(&gates)?;
        let mut x = self.conv(&block.project, &x, false)?;
        let gains = (self.gains)(block)?;
        if let Some(gains) = &gains {
            x = x.broadcast_mul(gains)?;
        }
        if block.residual {
            x = (x + &input)?;
        }
        self.keep(Given { input, gains });
        Ok(x)
    }

    fn head(&mut self, head: &ConvPlace, input: Tensor) -> Result<Tensor> {
        let features = self.conv(head, &input, true)?.mean((1, 2))?;
        self.keep(Given { input, gains: None });
        Ok(features)
    }
}

impl<'a> Part<'a> {
    pub fn new(
        parameters: &'a Tensor,
        start: usize,
        running: Option<Tensor>,
        gains: &'a mut dyn FnMut(&Block) -> Result<Option<Tensor>>,
    ) -> Self {
        Self {
            parameters,
            start,
            running,
            gains,
            moments: Vec::new(),
            tape: Vec::new(),
        }
    }

    fn values(&self, range: &Range<usize>) -> Result<Tensor> {
        self.parameters
            .narrow(0, range.start - self.start, range.len())
    }

    fn keep(&mut self, given: Given) {
        if self.running.is_none() {
            self.tape.push(given);
        }
    }

    /// A convolution and its normalisation, with SiLU behind it where it is `activated`.
    fn conv(&mut self, place: &ConvPlace, x: &Tensor, activated: bool) -> Result<Tensor> {
        let weight = self.values(&place.weight)?.reshape((place.channels, ()))?;
        let x = match place.kind {
            ConvKind::Pointwise => {
                let (images, height, width, _) = x.dims4()?;
                let out = x.flatten(0, 2)?.matmul(&weight.t()?)?;
                out.reshape((images, height, width, place.channels))?
            }
            ConvKind::Stem | ConvKind::Depthwise => depthwise(x, &weight, place.window)?,
        };
        self.normalise(&place.norm, &x, activated)
    }

    fn normalise(&mut self, place: &NormPlace, x: &Tensor, activated: bool) -> Result<Tensor> {
        // A bias lies behind its weight.
        let affine = self.values(&(place.weight.start..place.bias.end))?;
        let affine = affine.reshape((2, ()))?;
        match &self.running {
            Some(statistics) => {
                let of = |range: &Range<usize>| statistics.narrow(0, range.start, range.len());
                let (mean, variance) = (of(&place.mean)?, of(&place.variance)?);
                by_constants(x, &affine, &Moments { mean, variance }, activated)
            }
            None => {
                let count = x.dims()[..3].iter().product::<usize>() as f64;
                let moments = Moments::of(x)?;
                let x = by_batch(x, &affine, &moments, activated)?;
                self.moments.push(moments.mean);
                let unbiased = moments.variance * (count / (count - 1.0));
                self.moments.push(unbiased?);
                Ok(x)
            }
        }
    }

    fn linear(&self, place: &LinearPlace, x: &Tensor) -> Result<Tensor> {
        let weight = self.values(&place.weight)?;
        let weight = weight.reshape((place.bias.len(), ()))?;
        let product = x.matmul(&weight.t()?)?;
        product.broadcast_add(&self.values(&place.bias)?)
    }
}
