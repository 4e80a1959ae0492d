//! Inference: what each normalisation does is known beforehand, so that a convolution's output is normalised, activated and pooled
//! while it is in the cache, and each image is written and read once between two convolutions.
//!
//! An image's rows and pixels are shared out among threads in the same parts whatever their number.

use rayon::prelude::*;

use super::architecture::{Architecture, Block, ConvPlace};
use super::norm::running;
use super::squeeze::Squeeze;
use super::tape::tile_pixels;
use crate::kernels::batch_norm::{activate, activate_and_add, add_activated, normalise};
use crate::kernels::buffer::{Buffer, Pool};
use crate::kernels::depthwise::{channels_last, forward_row};
use crate::kernels::matrix::{Matrix, Store, multiply};
use crate::kernels::stem;

/// Everything that a pass reads.
pub struct Inference<'a> {
    pub architecture: &'a Architecture,
    pub parameters: &'a [f32],
    pub statistics: &'a [f32],
    pub pool: &'a Pool,
}

/// An activated image [height, width + 2 padding, channels], zero in the padding.
struct Padded {
    values: Buffer,
    height: usize,
    width: usize,
    row: usize,
}

impl Inference<'_> {
    /// Features [images, 1280] of images [images, height, width].
    pub fn run(&self, images: &[f32], height: usize, width: usize) -> Vec<f32> {
        let images = images.par_chunks(height * width);
        images
            .flat_map_iter(|image| self.image(image, height, width))
            .collect()
    }

    fn image(&self, image: &[f32], height: usize, width: usize) -> Vec<f32> {
        let columns = width;
        let (mut height, mut width) = (height.div_ceil(2), width.div_ceil(2));
        let mut x = self.pool.take(0);
        for (index, block) in self.architecture.blocks.iter().enumerate() {
            let expanded = match index {
                0 => self.stem(block, image, columns, height, width),
                _ => self.expand(block, &x, height, width),
            };
            let (depthwise, pooled) = self.depthwise(block, &expanded);
            let window = block.window;
            (height, width) = (window.output(height), window.output(width));
            let gate = Squeeze::forward(&block.squeeze, self.parameters, pooled).gate;
            x = self.project(block, &depthwise, &gate, &x);
        }
        self.head(&x)
    }

    /// The first convolution, activated [height, width, channels], of an image in rows of `columns`.
    fn stem(
        &self,
        block: &Block,
        image: &[f32],
        columns: usize,
        height: usize,
        width: usize,
    ) -> Padded {
        let place = &block.expand;
        let weights = channels_last(&self.parameters[place.weight.clone()], place.channels);
        self.padded(block, height, width, 8, |first, rows| {
            let each = rows.chunks_exact_mut(width * place.channels).enumerate();
            each.for_each(|(y, row)| stem::forward_row(image, columns, first + y, &weights, row));
        })
    }

    /// The pointwise convolution at the beginning of a block, activated.
    fn expand(&self, block: &Block, x: &[f32], height: usize, width: usize) -> Padded {
        let place = &block.expand;
        let weight = &self.parameters[place.weight.clone()];
        let columns = weight.len() / place.channels;
        let rows = tile_pixels(place.channels + columns).div_ceil(width);
        self.padded(block, height, width, rows, |first, out| {
            let start = first * width * columns;
            let input = &x[start..start + out.len() / place.channels * columns];
            let weight = Matrix::new(weight, columns).transposed();
            multiply(out, Matrix::new(input, columns), weight, Store::Replace);
        })
    }

    /// An image whose rows `make` writes, `at_once` of them from a first one on, as they are before normalisation.
    fn padded(
        &self,
        block: &Block,
        height: usize,
        width: usize,
        at_once: usize,
        make: impl Fn(usize, &mut [f32]) + Sync,
    ) -> Padded {
        let channels = block.expand.channels;
        let affine = running(&block.expand.norm, self.parameters, self.statistics);
        let margin = block.window.padding() * channels;
        let row = width * channels + 2 * margin;
        let mut values = self.pool.take(height * row);
        let parts = values.par_chunks_mut(at_once * row).enumerate();
        parts.for_each(|(number, out)| {
            let mut raw = self.pool.take(out.len() / row * width * channels);
            make(number * at_once, &mut raw);
            let raw = raw.chunks_exact(width * channels);
            for (raw, out) in raw.zip(out.chunks_exact_mut(row)) {
                out[..margin].fill(0.0);
                out[row - margin..].fill(0.0);
                activate(raw, &affine, None, &mut out[margin..row - margin]);
            }
        });
        Padded {
            values,
            height,
            width,
            row,
        }
    }

    /// The depthwise convolution, activated [pixels, channels], and the mean of each channel.
    fn depthwise(&self, block: &Block, input: &Padded) -> (Buffer, Vec<f32>) {
        let (place, window) = (&block.depthwise, block.window);
        let channels = place.channels;
        let weights = channels_last(&self.parameters[place.weight.clone()], channels);
        let affine = running(&place.norm, self.parameters, self.statistics);
        let (height, width) = (window.output(input.height), window.output(input.width));
        let zeros = vec![0.0; input.row];
        let row = width * channels;
        let mut out = self.pool.take(height * row);
        let at_once = height.div_ceil(8);
        let parts = out.par_chunks_mut(at_once * row).enumerate();
        let parts = parts.map(|(number, out)| {
            let mut sums = vec![0.0; channels];
            let mut raw = self.pool.take(row);
            for (y, out) in out.chunks_exact_mut(row).enumerate() {
                let first = (number * at_once + y) * window.stride;
                let under: [&[f32]; 5] = std::array::from_fn(|ky| {
                    let y = (first + ky).wrapping_sub(window.padding());
                    if y < input.height {
                        &input.values[y * input.row..][..input.row]
                    } else {
                        &zeros[..]
                    }
                });
                forward_row(
                    window,
                    &under[..window.kernel],
                    &weights,
                    channels,
                    &mut raw,
                );
                activate_and_add(&raw, &affine, out, &mut sums);
            }
            sums
        });
        // Summed in the order of the parts.
        let parts: Vec<Vec<f64>> = parts.collect();
        let mean = |c: usize| {
            let sum: f64 = parts.iter().map(|sums| sums[c]).sum();
            (sum / (height * width) as f64) as f32
        };
        (out, (0..channels).map(mean).collect())
    }

    /// The convolution at the end of a block, normalised, with the block's input where it adds it.
    ///
    /// The gates are multiplied into its weights, which are fewer than the pixels' values.
    fn project(&self, block: &Block, input: &[f32], gate: &[f32], added: &[f32]) -> Buffer {
        let place = &block.project;
        let (channels, columns) = (place.channels, gate.len());
        let mut weight = self.pool.take(place.weight.len());
        weight.copy_from_slice(&self.parameters[place.weight.clone()]);
        for row in weight.chunks_exact_mut(columns) {
            row.iter_mut().zip(gate).for_each(|(w, gate)| *w *= gate);
        }
        let affine = running(&place.norm, self.parameters, self.statistics);
        let mut out = self.pool.take(input.len() / columns * channels);
        let tile = tile_pixels(channels + columns);
        let parts = out.par_chunks_mut(tile * channels).enumerate();
        parts.for_each(|(number, out)| {
            let start = number * tile;
            let mut raw = self.pool.take(out.len());
            let input = &input[start * columns..][..out.len() / channels * columns];
            let weight = Matrix::new(&weight, columns).transposed();
            multiply(
                &mut raw,
                Matrix::new(input, columns),
                weight,
                Store::Replace,
            );
            let added = block
                .residual
                .then(|| &added[start * channels..][..out.len()]);
            normalise(&raw, &affine, 1.0, added, out);
        });
        out
    }

    /// The last convolution, activated and averaged over the image.
    fn head(&self, input: &[f32]) -> Vec<f32> {
        let place: &ConvPlace = &self.architecture.head;
        let channels = place.channels;
        let weight = &self.parameters[place.weight.clone()];
        let columns = weight.len() / channels;
        let affine = running(&place.norm, self.parameters, self.statistics);
        let tile = tile_pixels(channels + columns);
        let parts = input.par_chunks(tile * columns).map(|input| {
            let mut raw = self.pool.take(input.len() / columns * channels);
            let weight = Matrix::new(weight, columns).transposed();
            multiply(
                &mut raw,
                Matrix::new(input, columns),
                weight,
                Store::Replace,
            );
            let mut sums = vec![0.0; channels];
            add_activated(&raw, &affine, &mut sums);
            sums
        });
        let parts: Vec<Vec<f64>> = parts.collect();
        let pixels = (input.len() / columns) as f64;
        let mean = |c: usize| (parts.iter().map(|sums| sums[c]).sum::<f64>() / pixels) as f32;
        (0..channels).map(mean).collect()
    }
}
