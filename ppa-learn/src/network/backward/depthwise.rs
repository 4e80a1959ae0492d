//! Backward pass through the depthwise convolution.

use rayon::prelude::*;

use super::super::architecture::Block;
use super::super::forward::total;
use super::super::tape::{BlockTape, Size};
use super::{Backward, Gated};
use crate::kernels::batch_norm::{activate_with_derivative, add};
use crate::kernels::buffer::Buffer;
use crate::kernels::depthwise::{Rows, channels_first, channels_last};
use crate::kernels::depthwise_backward::{InputRow, add_weight_gradient};
use crate::kernels::gradient::{ActivationGradient, Linear};

impl Backward<'_> {
    /// Backward pass through the depthwise convolution: returns the gradient of the expansion's activation input, and the
    /// linear map from it to the gradient of the expansion.
    pub(super) fn depthwise(
        &mut self,
        block: &Block,
        tape: &BlockTape,
        gated: Gated,
        of_gated: Buffer,
    ) -> (Linear, Buffer) {
        let (place, window) = (&block.depthwise, block.depthwise.window);
        let channels = place.channels;
        let weights = channels_last(&self.parameters[place.weight.clone()], channels);
        let (expand, depthwise) = (&tape.expand, &tape.depthwise);
        let (size, size_out) = (expand.size, depthwise.size);
        let (row, row_out) = (size.width * channels, size_out.width * channels);
        let (kernel, stride, padding) = (window.kernel, window.stride, window.padding());
        let mut of_expanded = self.pool.take(size.count() * channels);
        let parts: Vec<(Vec<f32>, Vec<f64>)> = of_expanded
            .par_chunks_mut(size.images_per_task() * size.height * row)
            .enumerate()
            .map(|(task, of_expanded)| {
                let mut of_weights = vec![0.0; weights.len()];
                let mut sums = vec![0.0; 2 * channels];
                // Input rows are kept until their gradient is known, a stride after the kernel has passed.
                let count = kernel + stride;
                let rows = |count, size: Size, padding| {
                    Rows::new(self.pool, count, size.height, size.width, padding, channels)
                };
                let mut active = rows(count, size, padding);
                let mut derivative = rows(count, size, 0);
                let mut gradient = rows(kernel, size_out, padding);
                for (index, of_expanded) in of_expanded.chunks_mut(size.height * row).enumerate() {
                    let image = task * size.images_per_task() + index;
                    active.clear();
                    derivative.clear();
                    gradient.clear();
                    let pixels = &expand.pixels[image * size.height * row..][..size.height * row];
                    let (mut next_active, mut next_done) = (0, 0);
                    for y in 0..size_out.height {
                        let top = (y * stride) as isize - padding as isize;
                        while next_active < size.height
                            && (next_active as isize) < top + kernel as isize
                        {
                            let pixels = &pixels[next_active * row..][..row];
                            activate_with_derivative(
                                pixels,
                                &expand.norm.affine,
                                active.place(next_active),
                                derivative.place(next_active),
                            );
                            next_active += 1;
                        }
                        let at = (image * size_out.height + y) * row_out;
                        ActivationGradient {
                            upstream: Some(&of_gated[at..at + row_out]),
                            pixels: &depthwise.pixels[at..at + row_out],
                            affine: &depthwise.norm.affine,
                            linear: &gated.linear,
                            gate: &tape.squeeze.gate[image * channels..][..channels],
                            pooled: &gated.pooled[image * channels..][..channels],
                            out: gradient.place(y),
                        }
                        .run();
                        let under: Vec<&[f32]> = (0..kernel)
                            .map(|ky| active.padded(top + ky as isize))
                            .collect();
                        add_weight_gradient(
                            window,
                            &under,
                            gradient.inner(y),
                            channels,
                            &mut of_weights,
                        );
                        // Input row r receives from output rows up to (r + padding) / stride.
                        let done = if y + 1 == size_out.height {
                            size.height
                        } else {
                            ((y + 1) * stride).saturating_sub(padding)
                        };
                        while next_done < done {
                            let from = rows_from(next_done, kernel, stride, padding, &gradient);
                            let mut part = vec![0.0; 2 * channels];
                            InputRow {
                                rows: &from,
                                weights: &weights,
                                derivative: derivative.inner(next_done),
                                pixels: &pixels[next_done * row..][..row],
                                mean: &expand.norm.mean,
                                out: &mut of_expanded[next_done * row..][..row],
                                sums: &mut part,
                            }
                            .run(window);
                            add(&mut sums, &part);
                            next_done += 1;
                        }
                    }
                }
                (of_weights, sums)
            })
            .collect();
        let (of_weights, sums): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
        let of_weights = total(of_weights.into_par_iter());
        self.gradients[place.weight.clone()]
            .copy_from_slice(&channels_first(&of_weights, channels));
        let sums = total(sums.into_par_iter());
        let linear = expand
            .norm
            .backward(&block.expand.norm, &sums, size.count(), self.gradients);
        (linear, of_expanded)
    }
}

/// Returns the rows of the output's gradient to which input row `y` contributed, each with its row of the kernel.
fn rows_from(
    y: usize,
    kernel: usize,
    stride: usize,
    padding: usize,
    gradient: &Rows,
) -> Vec<(usize, &[f32])> {
    (0..kernel)
        .filter(|ky| y + padding >= *ky && (y + padding - ky).is_multiple_of(stride))
        .map(|ky| (ky, (y + padding - ky) / stride))
        .filter(|(_, from)| *from < gradient.height)
        .map(|(ky, from)| (ky, gradient.padded(from as isize)))
        .collect()
}
