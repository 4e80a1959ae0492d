//! Backward pass through the first convolution of a block.

use rayon::prelude::*;

use super::super::architecture::Block;
use super::super::forward::total;
use super::super::tape::{BlockTape, tile_pixels};
use super::Backward;
use crate::kernels::buffer::Buffer;
use crate::kernels::depthwise::channels_first;
use crate::kernels::gradient::{Linear, combine};
use crate::kernels::matrix::{Matrix, Store, multiply};
use crate::kernels::stem;

impl Backward<'_> {
    /// Backward pass through the expansion: replaces `gradient` of the block's output by that of its input.
    pub(super) fn expand(
        &mut self,
        block: &Block,
        tape: &BlockTape,
        linear: &Linear,
        of_expanded: &[f32],
        gradient: &mut Buffer,
    ) {
        let (place, size) = (&block.expand, tape.expand.size);
        let (channels, columns) = (place.channels, place.inputs);
        let weight = &self.parameters[place.weight.clone()];
        // With a residual, the input's gradient is the sum of the output's and the branch's.
        let store = if block.residual {
            Store::Add
        } else {
            Store::Replace
        };
        if !block.residual {
            *gradient = self.pool.take(size.count() * columns);
        }
        let task = size.pixels_per_product();
        let parts = gradient.par_chunks_mut(task * columns).enumerate();
        let of_weight = total(parts.map(|(index, of_input)| {
            let mut sums = vec![0.0; weight.len()];
            let tile = tile_pixels(3 * channels + 2 * columns);
            let mut of_pixels = self.pool.take(tile * channels);
            for (number, of_input) in of_input.chunks_mut(tile * columns).enumerate() {
                let start = index * task + number * tile;
                let run = start..start + of_input.len() / columns;
                let of_pixels = &mut of_pixels[..run.len() * channels];
                let whole = run.start * channels..run.end * channels;
                combine(
                    &of_expanded[whole.clone()],
                    &tape.expand.pixels[whole],
                    linear,
                    1.0,
                    of_pixels,
                );
                let input = &tape.input.pixels[run.start * columns..run.end * columns];
                let left = Matrix::new(of_pixels, channels);
                multiply(
                    &mut sums,
                    left.transposed(),
                    Matrix::new(input, columns),
                    Store::Add,
                );
                multiply(of_input, left, Matrix::new(weight, columns), store);
            }
            sums
        }));
        self.gradients[place.weight.clone()].copy_from_slice(&of_weight);
    }

    /// Computes the gradient of the first convolution's weights.
    pub(super) fn stem(
        &mut self,
        block: &Block,
        tape: &BlockTape,
        linear: &Linear,
        of_expanded: &[f32],
    ) {
        let (place, size) = (&block.expand, tape.expand.size);
        let (row, image_size) = (size.width * place.channels, tape.input.size);
        let images = tape
            .input
            .pixels
            .par_chunks(image_size.pixels())
            .enumerate();
        let of_weights = total(images.map(|(index, image)| {
            let mut sums = vec![0.0; stem::TAPS * place.channels];
            let mut of_pixels = self.pool.take(row);
            for y in 0..size.height {
                let at = (index * size.height + y) * row;
                combine(
                    &of_expanded[at..at + row],
                    &tape.expand.pixels[at..at + row],
                    linear,
                    1.0,
                    &mut of_pixels,
                );
                stem::add_weight_gradient(image, image_size.width, y, &of_pixels, &mut sums);
            }
            sums
        }));
        self.gradients[place.weight.clone()]
            .copy_from_slice(&channels_first(&of_weights, place.channels));
    }
}
