//! Backward pass through pooling and the last convolution.

use rayon::prelude::*;

use super::super::forward::total;
use super::super::tape::{Normed, by_image, tile_pixels};
use super::{Backward, scaled};
use crate::kernels::buffer::Buffer;
use crate::kernels::gradient::{ActivationGradient, ActivationSums};
use crate::kernels::matrix::{Matrix, Store, multiply};

impl Backward<'_> {
    /// Returns the gradient of the last block's output.
    pub(super) fn head(&mut self, input: &[f32], head: &Normed, of_features: &[f32]) -> Buffer {
        let (place, size) = (&self.architecture.head, head.size);
        let (channels, columns) = (place.channels, place.inputs);
        let per_image = size.pixels() * channels;
        let pooled: Vec<f32> = of_features
            .iter()
            .map(|g| g / size.pixels() as f32)
            .collect();
        let images = head
            .pixels
            .par_chunks(per_image)
            .zip(pooled.par_chunks(channels));
        let sums = total(images.map(|(pixels, pooled)| {
            let mut sums = ActivationSums::zeros(channels);
            for part in pixels.chunks(256 * channels) {
                sums.add(None, part, &head.norm.affine, &head.norm.mean);
            }
            scaled(&sums.derivative, pooled)
        }));
        let linear = head
            .norm
            .backward(&place.norm, &sums, size.count(), self.gradients);

        let weight = &self.parameters[place.weight.clone()];
        let mut of_input = self.pool.take(size.count() * columns);
        let task = size.pixels_per_product();
        let parts = of_input.par_chunks_mut(task * columns).enumerate();
        let of_weight = total(parts.map(|(index, of_input)| {
            let mut sums = vec![0.0; weight.len()];
            let tile = tile_pixels(2 * channels + columns);
            let mut of_pixels = self.pool.take(tile * channels);
            for (number, of_input) in of_input.chunks_mut(tile * columns).enumerate() {
                let start = index * task + number * tile;
                let run = start..start + of_input.len() / columns;
                let of_pixels = &mut of_pixels[..run.len() * channels];
                for (image, part) in by_image(run.clone(), size) {
                    let pixels =
                        (run.start + part.start) * channels..(run.start + part.end) * channels;
                    ActivationGradient {
                        upstream: None,
                        pixels: &head.pixels[pixels],
                        affine: &head.norm.affine,
                        linear: &linear,
                        gate: &pooled[image * channels..][..channels],
                        pooled: &pooled[image * channels..][..channels],
                        out: &mut of_pixels[part.start * channels..part.end * channels],
                    }
                    .run();
                }
                let input = &input[run.start * columns..run.end * columns];
                multiply(
                    &mut sums,
                    Matrix::new(of_pixels, channels).transposed(),
                    Matrix::new(input, columns),
                    Store::Add,
                );
                multiply(
                    of_input,
                    Matrix::new(of_pixels, channels),
                    Matrix::new(weight, columns),
                    Store::Replace,
                );
            }
            sums
        }));
        self.gradients[place.weight.clone()].copy_from_slice(&of_weight);
        of_input
    }
}
