//! The backward pass: the gradients of all parameters from that of the features.
//!
//! With a batch normalisation the gradient of a pixel needs sums over all pixels first. Each pass over the pixels therefore applies the sums of the
//! previous one and accumulates those for the next.

mod depthwise;
mod expand;
mod head;
mod project;

use super::architecture::{Architecture, ConvKind};
use super::tape::Tape;
use crate::kernels::buffer::Pool;
use crate::kernels::gradient::Linear;

/// Inputs of a backward pass, and the gradients that it writes, laid out as the parameters.
pub struct Backward<'a> {
    pub architecture: &'a Architecture,
    pub parameters: &'a [f32],
    pub gradients: &'a mut [f32],
    pub pool: &'a Pool,
}

impl Backward<'_> {
    /// Computes all gradients from that of the features [images, 1280].
    pub fn run(mut self, tape: Tape, of_features: &[f32]) {
        let mut gradient = self.head(&tape.head_input.pixels, &tape.head, of_features);
        drop((tape.head_input, tape.head));
        for (block, tape) in self.architecture.blocks.iter().zip(tape.blocks).rev() {
            let (linear, of_output) = self.project(block, &tape, &gradient);
            let (linear, of_expanded) = self.depthwise(block, &tape, linear, of_output);
            match block.expand.kind {
                ConvKind::Pointwise => {
                    self.expand(block, &tape, &linear, &of_expanded, &mut gradient);
                }
                // Images have no gradient.
                ConvKind::Stem | ConvKind::Depthwise => {
                    self.stem(block, &tape, &linear, &of_expanded);
                }
            }
        }
    }
}

/// Multiplies two rows of sums by one factor for each channel.
fn scaled(sums: &[f64], factors: &[f32]) -> Vec<f64> {
    sums.iter()
        .zip(factors.iter().cycle())
        .map(|(sum, factor)| sum * f64::from(*factor))
        .collect()
}

/// Terms of the gradient of a depthwise convolution given that of its gated activation.
struct Gated {
    linear: Linear,
    /// [images, channels]
    pooled: Vec<f32>,
}
