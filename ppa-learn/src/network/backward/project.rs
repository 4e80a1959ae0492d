//! Backward pass through residual, projection and squeeze-and-excitation.

use rayon::prelude::*;

use super::super::architecture::Block;
use super::super::forward::{gated, total};
use super::super::tape::{BlockTape, by_image, tile_pixels};
use super::{Backward, Gated, scaled};
use crate::kernels::buffer::Buffer;
use crate::kernels::gradient::{ActivationSums, add_gradient_sums, combine};
use crate::kernels::matrix::{Matrix, Store, multiply};

impl Backward<'_> {
    /// Backward pass through residual, projection and squeeze-and-excitation: returns the terms of the gradient of the depthwise
    /// convolution, and the gradient of the gated activation.
    pub(super) fn project(
        &mut self,
        block: &Block,
        tape: &BlockTape,
        of_output: &[f32],
    ) -> (Gated, Buffer) {
        let (place, size) = (&block.project, tape.project.size);
        let (project, depthwise) = (&tape.project, &tape.depthwise);
        let (channels, columns) = (place.channels, block.depthwise.channels);
        let per_image = size.pixels() * channels;
        let images = project
            .pixels
            .par_chunks(per_image)
            .zip(of_output.par_chunks(per_image))
            .zip(&tape.gains);
        let sums = total(images.map(|((pixels, gradient), gain)| {
            let mut sums = vec![0.0; 2 * channels];
            let tile = 256 * channels;
            for (pixels, gradient) in pixels.chunks(tile).zip(gradient.chunks(tile)) {
                add_gradient_sums(gradient, pixels, &project.norm.mean, *gain, &mut sums);
            }
            sums
        }));
        let linear = project
            .norm
            .backward(&place.norm, &sums, size.count(), self.gradients);

        let weight = &self.parameters[place.weight.clone()];
        let mut of_gated = self.pool.take(size.count() * columns);
        let task = size.pixels_per_product();
        let parts: Vec<(Vec<f32>, Vec<ActivationSums>)> = of_gated
            .par_chunks_mut(task * columns)
            .enumerate()
            .map(|(index, of_gated)| {
                let mut of_weight = vec![0.0; weight.len()];
                let mut sums = vec![
                    ActivationSums::zeros(columns);
                    of_gated.len() / (size.pixels() * columns)
                ];
                let tile = tile_pixels(2 * channels + 3 * columns);
                let mut active = self.pool.take(tile * columns);
                let mut of_pixels = self.pool.take(tile * channels);
                for (number, of_gated) in of_gated.chunks_mut(tile * columns).enumerate() {
                    let start = index * task + number * tile;
                    let run = start..start + of_gated.len() / columns;
                    let active = &mut active[..run.len() * columns];
                    let of_pixels = &mut of_pixels[..run.len() * channels];
                    gated(
                        &depthwise.pixels,
                        &depthwise.norm.affine,
                        &tape.squeeze.gate,
                        size,
                        run.clone(),
                        active,
                    );
                    for (image, part) in by_image(run.clone(), size) {
                        let whole =
                            (run.start + part.start) * channels..(run.start + part.end) * channels;
                        let out = &mut of_pixels[part.start * channels..part.end * channels];
                        combine(
                            &of_output[whole.clone()],
                            &project.pixels[whole],
                            &linear,
                            tape.gains[image],
                            out,
                        );
                    }
                    let left = Matrix::new(of_pixels, channels);
                    multiply(
                        &mut of_weight,
                        left.transposed(),
                        Matrix::new(active, columns),
                        Store::Add,
                    );
                    multiply(of_gated, left, Matrix::new(weight, columns), Store::Replace);
                    for (image, part) in by_image(run.clone(), size) {
                        let pixels = &depthwise.pixels
                            [(run.start + part.start) * columns..(run.start + part.end) * columns];
                        let upstream = &of_gated[part.start * columns..part.end * columns];
                        let sums = &mut sums[image - index * size.images_per_product()];
                        sums.add(
                            Some(upstream),
                            pixels,
                            &depthwise.norm.affine,
                            &depthwise.norm.mean,
                        );
                    }
                }
                (of_weight, sums)
            })
            .collect();
        let (of_weight, sums): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
        let of_weight = total(of_weight.into_par_iter());
        self.gradients[place.weight.clone()].copy_from_slice(&of_weight);
        let sums: Vec<ActivationSums> = sums.into_iter().flatten().collect();

        let of_gate: Vec<f32> = sums
            .iter()
            .flat_map(|sums| &sums.gate)
            .map(|&sum| sum as f32)
            .collect();
        let mut pooled =
            tape.squeeze
                .backward(&block.squeeze, self.parameters, &of_gate, self.gradients);
        pooled.iter_mut().for_each(|g| *g /= size.pixels() as f32);
        let mut of_norm = vec![0.0; 2 * columns];
        for (image, sums) in sums.iter().enumerate() {
            let here = image * columns..(image + 1) * columns;
            let upstream = scaled(&sums.upstream, &tape.squeeze.gate[here.clone()]);
            for ((sum, a), b) in of_norm
                .iter_mut()
                .zip(upstream)
                .zip(scaled(&sums.derivative, &pooled[here]))
            {
                *sum += a + b;
            }
        }
        let linear = depthwise.norm.backward(
            &block.depthwise.norm,
            &of_norm,
            size.count(),
            self.gradients,
        );
        (Gated { linear, pooled }, of_gated)
    }
}
