//! Layers of the network, computed by our kernels and candle's matrix products on channels-last images [images, height, width, channels].

use candle_core::{Error, Result, Tensor};

use super::super::architecture::{Block, ConvKind, ConvPlace};
use super::super::layers::Layers;
use super::depthwise::depthwise;
use super::normalise::Normed;
use super::parameters::Parameters;
use super::squeeze::Gate;

/// A pass through the layers.
pub struct Forward<'a> {
    pub parameters: Parameters<'a>,
    /// The running statistics for evaluation; `None` to normalise by the batch.
    pub running: Option<&'a Tensor>,
    /// Returns the gains [images, 1] of stochastic depth of a residual block in training.
    pub gains: &'a mut dyn FnMut(&Block) -> Result<Option<Tensor>>,
    /// Means and unbiased variances of the batch, in the order of the running statistics.
    pub moments: Vec<Tensor>,
    pub tape: Tape,
}

/// Values of a training pass that the gradient needs.
#[derive(Default)]
pub struct Tape {
    /// Tapes of the blocks, in order.
    pub blocks: Vec<BlockTape>,
    /// Input and output of the head's convolution.
    pub head: Option<(Tensor, Normed)>,
}

/// Values that the gradient of a block needs.
pub struct BlockTape {
    pub input: Tensor,
    pub expanded: Expanded,
    pub filtered: Normed,
    pub gate: Gate,
    /// The filtered image times its gates.
    pub gated: Tensor,
    pub projected: Normed,
    /// [images, channels] of the output
    pub gains: Option<Tensor>,
}

/// The expansion's convolution, and the activated image.
pub struct Expanded {
    pub normed: Normed,
    pub image: Tensor,
}

/// The depthwise convolution, before its activation.
pub struct Filtered {
    expanded: Expanded,
    normed: Normed,
}

impl Layers for Forward<'_> {
    type Image = Tensor;
    type Filtered = Filtered;
    type Gate = Gate;
    type Features = Tensor;
    type Error = Error;

    fn filter(&mut self, block: &Block, x: &Tensor) -> Result<Filtered> {
        let normed = self.conv(&block.expand, x, true)?;
        let image = normed.image(None, None)?;
        let expanded = Expanded { normed, image };
        let normed = self.conv(&block.depthwise, &expanded.image, true)?;
        Ok(Filtered { expanded, normed })
    }

    fn squeeze(&mut self, block: &Block, filtered: &Filtered) -> Result<Gate> {
        Gate::new(&block.squeeze, self.parameters, filtered.normed.mean()?)
    }

    fn project(
        &mut self,
        block: &Block,
        filtered: Filtered,
        gate: Gate,
        input: Tensor,
    ) -> Result<Tensor> {
        let Filtered { expanded, normed } = filtered;
        let gated = normed.image(Some(&gate.gates), None)?;
        let projected = self.conv(&block.project, &gated, false)?;
        let gains = match (self.gains)(block)? {
            Some(gains) => {
                let shape = (gains.dim(0)?, block.project.channels);
                Some(gains.broadcast_as(shape)?.contiguous()?)
            }
            None => None,
        };
        let output = projected.image(gains.as_ref(), block.residual.then_some(&input))?;
        if self.running.is_none() {
            self.tape.blocks.push(BlockTape {
                input,
                expanded,
                filtered: normed,
                gate,
                gated,
                projected,
                gains,
            });
        }
        Ok(output)
    }

    fn head(&mut self, head: &ConvPlace, input: Tensor) -> Result<Tensor> {
        let normed = self.conv(head, &input, true)?;
        let features = normed.mean()?;
        if self.running.is_none() {
            self.tape.head = Some((input, normed));
        }
        Ok(features)
    }
}

impl Forward<'_> {
    /// Computes a convolution and its normalisation, followed by SiLU if `activated`.
    fn conv(&mut self, place: &ConvPlace, x: &Tensor, activated: bool) -> Result<Normed> {
        let weight = self.parameters.rows(&place.weight, place.channels)?;
        let x = match place.kind {
            ConvKind::Pointwise => {
                let (images, height, width, _) = x.dims4()?;
                let out = x.flatten(0, 2)?.matmul(&weight.t()?)?;
                out.reshape((images, height, width, place.channels))?
            }
            ConvKind::Stem | ConvKind::Depthwise => depthwise(x, &weight, place.window)?,
        };
        let affine = self.parameters.affine(&place.norm)?;
        match self.running {
            Some(statistics) => {
                let [mean, variance] = [&place.norm.mean, &place.norm.variance]
                    .map(|range| Parameters(statistics).values(range));
                Normed::by_moments(x, &affine, &mean?, &variance?, activated)
            }
            None => {
                let normed = Normed::by_batch(x, &affine, activated)?;
                self.moments.extend(normed.moments()?);
                Ok(normed)
            }
        }
    }
}
