//! The backward pass: the gradient of every parameter from that of the features.
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

/// What a backward pass reads, and the gradients that it writes, laid out as the parameters.
pub struct Backward<'a> {
    pub architecture: &'a Architecture,
    pub parameters: &'a [f32],
    pub gradients: &'a mut [f32],
    pub pool: &'a Pool,
}

impl Backward<'_> {
    /// Writes all gradients, from that of the features [images, 1280].
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

/// Two rows of sums times one factor for each channel.
fn scaled(sums: &[f64], factors: &[f32]) -> Vec<f64> {
    sums.iter()
        .zip(factors.iter().cycle())
        .map(|(sum, factor)| sum * f64::from(*factor))
        .collect()
}

/// How the gradient of a depthwise convolution follows from that of its gated activation.
struct Gated {
    linear: Linear,
    /// [images, channels]
    pooled: Vec<f32>,
}
