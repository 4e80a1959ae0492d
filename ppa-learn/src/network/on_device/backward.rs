//! Gradients of the layers.

use candle_core::{Result, Tensor};

use super::super::architecture::{Architecture, Block, ConvKind, ConvPlace};
use super::depthwise;
use super::forward::{BlockTape, Tape};
use super::normalise::{Gradient, Normed};
use super::parameters::{Gradients, Parameters};

/// The backward pass from the features to the parameters.
pub struct Backward<'a> {
    parameters: Parameters<'a>,
    gradients: Gradients,
}

impl<'a> Backward<'a> {
    /// Computes the gradient of all parameters from that of the features [images, channels].
    pub fn run(
        architecture: &Architecture,
        parameters: &'a Tensor,
        tape: Tape,
        of_features: &Tensor,
    ) -> Result<Tensor> {
        let mut back = Self {
            parameters: Parameters(parameters),
            gradients: Gradients::default(),
        };
        let (input, normed) = tape.head.expect("a pass ends with the head");
        let each = (of_features / normed.pixels() as f64)?;
        let of_mean = Gradient {
            addend: Some(&each),
            ..Gradient::default()
        };
        let mut of_output = back.pointwise(&architecture.head, &input, &normed, of_mean)?;
        let blocks = architecture.blocks.iter().zip(tape.blocks);
        for (block, tape) in blocks.rev() {
            match back.block(block, tape, &of_output)? {
                Some(of_input) => of_output = of_input,
                // Images have none.
                None => break,
            }
        }
        back.gradients.flat()
    }

    /// Computes the gradient of a block's input; `None` if that is the network's input image.
    fn block(
        &mut self,
        block: &Block,
        tape: BlockTape,
        of_output: &Tensor,
    ) -> Result<Option<Tensor>> {
        let of_projected = Gradient {
            image: Some(of_output),
            factor: tape.gains.as_ref(),
            addend: None,
        };
        let projected = &tape.projected;
        let of_gated = self.pointwise(&block.project, &tape.gated, projected, of_projected)?;

        let of_gates = tape.filtered.dot(&of_gated)?;
        let (place, parameters) = (&block.squeeze, self.parameters);
        let of_mean = tape
            .gate
            .backward(place, parameters, &of_gates, &mut self.gradients)?;
        let each = (of_mean / tape.filtered.pixels() as f64)?;
        let of_filtered = Gradient {
            image: Some(&of_gated),
            factor: Some(&tape.gate.gates),
            addend: Some(&each),
        };
        let (of_filtered, of_affine) = tape.filtered.gradients(of_filtered)?;
        self.gradients
            .add_affine(&block.depthwise.norm, of_affine)?;

        let (image, window) = (&tape.expanded.image, block.depthwise.window);
        let of_weight = depthwise::of_weights(image, &of_filtered, window)?;
        self.gradients.add(&block.depthwise.weight, of_weight)?;
        let weight = self.weight(&block.depthwise)?;
        let of_expanded = depthwise::of_input(&of_filtered, &weight, window, image)?;
        let of_expanded = Gradient {
            image: Some(&of_expanded),
            ..Gradient::default()
        };
        let (expand, expanded) = (&block.expand, &tape.expanded.normed);
        if expand.kind == ConvKind::Stem {
            let (of_x, of_affine) = expanded.gradients(of_expanded)?;
            self.gradients.add_affine(&expand.norm, of_affine)?;
            let of_weight = depthwise::of_weights(&tape.input, &of_x, expand.window)?;
            self.gradients.add(&expand.weight, of_weight)?;
            return Ok(None);
        }
        let of_input = self.pointwise(expand, &tape.input, expanded, of_expanded)?;
        match block.residual {
            true => (of_input + of_output).map(Some),
            false => Ok(Some(of_input)),
        }
    }

    /// Computes the gradient of the input of a pointwise convolution from that of its normalised output.
    fn pointwise(
        &mut self,
        place: &ConvPlace,
        input: &Tensor,
        normed: &Normed,
        of_normed: Gradient,
    ) -> Result<Tensor> {
        let (of_x, of_affine) = normed.gradients(of_normed)?;
        self.gradients.add_affine(&place.norm, of_affine)?;
        let (of_x, rows) = (of_x.flatten(0, 2)?, input.flatten(0, 2)?);
        self.gradients
            .add(&place.weight, of_x.t()?.matmul(&rows)?)?;
        of_x.matmul(&self.weight(place)?)?.reshape(input.shape())
    }

    /// Returns the weights [channels, inputs or taps] of a convolution.
    fn weight(&self, place: &ConvPlace) -> Result<Tensor> {
        self.parameters.rows(&place.weight, place.channels)
    }
}
