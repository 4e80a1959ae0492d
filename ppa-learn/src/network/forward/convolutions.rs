//! The four kinds of convolution, each with the moments of its output.

use rayon::prelude::*;

use super::super::architecture::ConvPlace;
use super::super::tape::{Images, Normed, Size, tile_pixels};
use super::{Forward, gated, total};
use crate::kernels::batch_norm::{activate, add_moments};
use crate::kernels::depthwise::{Rows, channels_last, forward_row};
use crate::kernels::matrix::{Matrix, Store, multiply};
use crate::kernels::stem;

impl Forward<'_> {
    /// Returns the centre about which moments are taken.
    fn center(&self, place: &ConvPlace) -> &[f32] {
        &self.statistics[place.norm.mean.clone()]
    }

    pub(super) fn stem(
        &self,
        place: &ConvPlace,
        images: &Images,
        size_out: Size,
        out: &mut [f32],
    ) -> Vec<f64> {
        let (size, images) = (images.size, &images.pixels);
        let weights = channels_last(&self.parameters[place.weight.clone()], place.channels);
        let row = size_out.width * place.channels;
        let center = self.center(place);
        let task = size.images_per_task();
        let parts = out
            .par_chunks_mut(task * size_out.height * row)
            .zip(images.par_chunks(task * size.pixels()));
        total(parts.map(|(out, images)| {
            let mut sums = vec![0.0; 2 * place.channels];
            for (image, out) in images
                .chunks(size.pixels())
                .zip(out.chunks_mut(size_out.height * row))
            {
                for (y, out) in out.chunks_mut(row).enumerate() {
                    stem::forward_row(image, size.width, y, &weights, out);
                    add_moments(out, center, &mut sums);
                }
            }
            sums
        }))
    }

    pub(super) fn pointwise(
        &self,
        place: &ConvPlace,
        input: &[f32],
        size: Size,
        out: &mut [f32],
    ) -> Vec<f64> {
        let (channels, columns) = (place.channels, place.inputs);
        let weight = Matrix::new(&self.parameters[place.weight.clone()], columns).transposed();
        let center = self.center(place);
        let task = size.pixels_per_product();
        let parts = out
            .par_chunks_mut(task * channels)
            .zip(input.par_chunks(task * columns));
        total(parts.map(|(out, input)| {
            let mut sums = vec![0.0; 2 * channels];
            let tile = tile_pixels(channels + columns);
            for (out, input) in out
                .chunks_mut(tile * channels)
                .zip(input.chunks(tile * columns))
            {
                multiply(out, Matrix::new(input, columns), weight, Store::Replace);
                add_moments(out, center, &mut sums);
            }
            sums
        }))
    }

    pub(super) fn depthwise(
        &self,
        place: &ConvPlace,
        input: &Normed,
        size_out: Size,
        out: &mut [f32],
    ) -> Vec<f64> {
        let (size, window) = (input.size, place.window);
        let channels = place.channels;
        let weights = channels_last(&self.parameters[place.weight.clone()], channels);
        let center = self.center(place);
        let (kernel, padding) = (window.kernel, window.padding());
        let (row, row_out) = (size.width * channels, size_out.width * channels);
        let task = size.images_per_task();
        let parts = out
            .par_chunks_mut(task * size_out.height * row_out)
            .zip(input.pixels.par_chunks(task * size.height * row));
        total(parts.map(|(out, pixels)| {
            let mut sums = vec![0.0; 2 * channels];
            let mut rows = Rows::new(
                self.pool,
                kernel,
                size.height,
                size.width,
                padding,
                channels,
            );
            for (out, pixels) in out
                .chunks_mut(size_out.height * row_out)
                .zip(pixels.chunks(size.height * row))
            {
                rows.clear();
                let mut next = 0;
                for (y, out) in out.chunks_mut(row_out).enumerate() {
                    let first = (y * window.stride) as isize - padding as isize;
                    while next < size.height && (next as isize) < first + kernel as isize {
                        activate(
                            &pixels[next * row..][..row],
                            &input.norm.affine,
                            None,
                            rows.place(next),
                        );
                        next += 1;
                    }
                    let under: Vec<&[f32]> = (0..kernel)
                        .map(|ky| rows.padded(first + ky as isize))
                        .collect();
                    forward_row(window, &under, &weights, channels, out);
                    add_moments(out, center, &mut sums);
                }
            }
            sums
        }))
    }

    pub(super) fn project(
        &self,
        place: &ConvPlace,
        input: &Normed,
        gates: &[f32],
        size: Size,
        out: &mut [f32],
    ) -> Vec<f64> {
        let (channels, columns) = (place.channels, place.inputs);
        let weight = Matrix::new(&self.parameters[place.weight.clone()], columns).transposed();
        let center = self.center(place);
        let task = size.pixels_per_product();
        let parts = out.par_chunks_mut(task * channels).enumerate();
        total(parts.map(|(index, out)| {
            let mut sums = vec![0.0; 2 * channels];
            let tile = tile_pixels(channels + 2 * columns);
            let mut active = self.pool.take(tile * columns);
            for (number, out) in out.chunks_mut(tile * channels).enumerate() {
                let start = index * task + number * tile;
                let run = start..start + out.len() / channels;
                let active = &mut active[..run.len() * columns];
                gated(&input.pixels, &input.norm.affine, gates, size, run, active);
                multiply(out, Matrix::new(active, columns), weight, Store::Replace);
                add_moments(out, center, &mut sums);
            }
            sums
        }))
    }
}
