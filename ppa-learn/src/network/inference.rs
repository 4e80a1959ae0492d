//! Inference: what each normalisation does is known beforehand, so that a convolution's output is normalised, activated and pooled
//! while it is in registers or the cache, and each image is written and read once between two convolutions.
//!
//! An image's rows and pixels are shared out among threads in the same parts whatever their number.

use std::convert::Infallible;

use rayon::prelude::*;

use super::architecture::{Architecture, Block, ConvPlace};
use super::folded::{Expansion, Folded, Taps};
use super::layers::Layers;
use super::squeeze::Squeeze;
use super::tape::{Images, Size, tile_pixels};
use crate::kernels::batch_norm::{activate, activate_and_add};
use crate::kernels::buffer::{Buffer, Pool};
use crate::kernels::depthwise::forward_row;
use crate::kernels::panels::Panels;
use crate::kernels::pointwise::{activated, normalised};
use crate::kernels::stem;

/// Everything that a pass reads.
#[derive(Clone, Copy)]
pub struct Inference<'a> {
    pub architecture: &'a Architecture,
    pub folded: &'a Folded,
    pub parameters: &'a [f32],
    pub pool: &'a Pool,
}

/// An activated image [height, width + 2 padding, channels], zero in the padding.
pub struct Padded {
    values: Buffer,
    /// Without the padding.
    size: Size,
    row: usize,
}

/// The activated output of a depthwise convolution, and the mean of each channel.
pub struct Filtered {
    image: Images,
    pooled: Vec<f32>,
}

/// What `work` gives of each part, in their order. A single thread works by itself: to wake another one costs more than a part.
fn of_each<T: Send, R: Send>(parts: Vec<T>, work: impl Fn(usize, T) -> R + Sync) -> Vec<R> {
    if rayon::current_num_threads() == 1 {
        let parts = parts.into_iter().enumerate();
        parts.map(|(number, part)| work(number, part)).collect()
    } else {
        let parts = parts.into_par_iter().enumerate();
        parts.map(|(number, part)| work(number, part)).collect()
    }
}

impl Inference<'_> {
    /// Features [images, 1280] of images [images, height, width].
    pub fn run(&self, images: &[f32], size: Size) -> Vec<f32> {
        let size = Size { images: 1, ..size };
        let images = images.chunks(size.pixels()).collect();
        let of_image = |_, image: &[f32]| {
            let image = Images::copied(image, size, self.pool);
            let Ok(features) = { *self }.features(self.architecture, image);
            features
        };
        of_each(images, of_image).concat()
    }

    /// The first convolution, activated, with the padding that `next` needs.
    fn stem(&self, taps: &Taps, next: &ConvPlace, image: &Images, size: Size) -> Padded {
        let margin = next.window.padding() * next.channels;
        self.padded(next, size, 8, |first, row, out| {
            let mut raw = self.pool.take(size.width * next.channels);
            for (y, out) in out.chunks_exact_mut(row).enumerate() {
                let (pixels, columns) = (&image.pixels, image.size.width);
                stem::forward_row(pixels, columns, first + y, &taps.weights, &mut raw);
                activate(&raw, &taps.affine, None, &mut out[margin..row - margin]);
            }
        })
    }

    /// The pointwise convolution at the beginning of a block, activated, with the padding that `next` needs.
    fn pointwise(&self, panels: &Panels, next: &ConvPlace, input: &Images) -> Padded {
        let (channels, columns) = (panels.channels(), panels.columns());
        let (size, width) = (input.size, input.size.width);
        let rows = tile_pixels(channels + columns).div_ceil(width);
        let margin = next.window.padding() * channels;
        self.padded(next, size, rows, |first, row, out| {
            let input = &input.pixels[first * width * columns..];
            let input = &input[..out.len() / row * width * columns];
            let place = |pixel| pixel / width * row + margin + pixel % width * channels;
            activated(input, panels, place, out);
        })
    }

    /// An image for the convolution `next`, whose rows between their padding `make` writes, `at_once` of them from a first one
    /// on, each of so many values.
    fn padded(
        &self,
        next: &ConvPlace,
        size: Size,
        at_once: usize,
        make: impl Fn(usize, usize, &mut [f32]) + Sync,
    ) -> Padded {
        let margin = next.window.padding() * next.channels;
        let row = size.width * next.channels + 2 * margin;
        let mut values = self.pool.take(size.height * row);
        let parts = values.chunks_mut(at_once * row).collect();
        of_each(parts, |number, out: &mut [f32]| {
            for out in out.chunks_exact_mut(row) {
                out[..margin].fill(0.0);
                out[row - margin..].fill(0.0);
            }
            make(number * at_once, row, out);
        });
        Padded { values, size, row }
    }
}

impl Layers for Inference<'_> {
    type Image = Images;
    type Expanded = Padded;
    type Filtered = Filtered;
    type Gate = Vec<f32>;
    type Features = Vec<f32>;
    type Error = Infallible;

    fn expand(&mut self, block: &Block, input: &Images) -> Result<Padded, Infallible> {
        let (size, next) = (input.size.after(block.expand.window), &block.depthwise);
        Ok(match &self.folded.blocks[block.number].expand {
            Expansion::Pointwise(panels) => self.pointwise(panels, next, input),
            Expansion::Stem(taps) => self.stem(taps, next, input, size),
        })
    }

    fn depthwise(&mut self, block: &Block, input: Padded) -> Result<Filtered, Infallible> {
        let taps = &self.folded.blocks[block.number].depthwise;
        let (channels, window) = (block.depthwise.channels, block.depthwise.window);
        let size = input.size.after(window);
        let zeros = vec![0.0; input.row];
        let row = size.width * channels;
        let mut pixels = self.pool.take(size.height * row);
        let at_once = size.height.div_ceil(8);
        let parts = pixels.chunks_mut(at_once * row).collect();
        let parts = of_each(parts, |number, out: &mut [f32]| {
            let mut sums = vec![0.0; channels];
            let mut raw = self.pool.take(row);
            for (y, out) in out.chunks_exact_mut(row).enumerate() {
                let first = (number * at_once + y) * window.stride;
                let under: [&[f32]; 5] = std::array::from_fn(|ky| {
                    let y = (first + ky).wrapping_sub(window.padding());
                    if y < input.size.height {
                        &input.values[y * input.row..][..input.row]
                    } else {
                        &zeros[..]
                    }
                });
                let under = &under[..window.kernel];
                forward_row(window, under, &taps.weights, channels, &mut raw);
                activate_and_add(&raw, &taps.affine, out, &mut sums);
            }
            sums
        });
        Ok(Filtered {
            image: Images { pixels, size },
            pooled: means(&parts, size.pixels()),
        })
    }

    fn squeeze(&mut self, block: &Block, filtered: &Filtered) -> Result<Vec<f32>, Infallible> {
        let pooled = filtered.pooled.clone();
        Ok(Squeeze::forward(&block.squeeze, self.parameters, pooled).gate)
    }

    /// The gates are multiplied into the weights, which are fewer than the pixels' values.
    fn project(
        &mut self,
        block: &Block,
        filtered: Filtered,
        gate: Vec<f32>,
        added: Images,
    ) -> Result<Images, Infallible> {
        let panels = &self.folded.blocks[block.number].project;
        let (channels, columns) = (panels.channels(), panels.columns());
        let gated = panels.gated(&gate, self.pool);
        let (input, size) = (filtered.image.pixels, filtered.image.size);
        let mut pixels = self.pool.take(size.pixels() * channels);
        let tile = tile_pixels(channels + columns);
        let parts = pixels.chunks_mut(tile * channels).collect();
        of_each(parts, |number, out: &mut [f32]| {
            let start = number * tile;
            let input = &input[start * columns..][..out.len() / channels * columns];
            let added = block
                .residual
                .then(|| &added.pixels[start * channels..][..out.len()]);
            normalised(input, &gated, added, out);
        });
        Ok(Images { pixels, size })
    }

    fn head(&mut self, _: &ConvPlace, input: Images) -> Result<Vec<f32>, Infallible> {
        let panels = &self.folded.head;
        let (channels, columns) = (panels.channels(), panels.columns());
        let parts = input
            .pixels
            .chunks(tile_pixels(channels + columns) * columns)
            .collect();
        let parts = of_each(parts, |_, input: &[f32]| {
            let mut active = self.pool.take(input.len() / columns * channels);
            activated(input, panels, |pixel| pixel * channels, &mut active);
            let mut sums = vec![0.0; channels];
            for pixel in active.chunks_exact(channels) {
                for (sum, x) in sums.iter_mut().zip(pixel) {
                    *sum += f64::from(*x);
                }
            }
            sums
        });
        Ok(means(&parts, input.size.pixels()))
    }
}

/// The mean of each channel, from the sums of some parts in their order.
fn means(parts: &[Vec<f64>], pixels: usize) -> Vec<f32> {
    let mean = |c: usize| (parts.iter().map(|sums| sums[c]).sum::<f64>() / pixels as f64) as f32;
    (0..parts[0].len()).map(mean).collect()
}
