//! Inference: what each normalisation does is known beforehand, so that a convolution's output is normalised, activated and pooled
//! while it is in registers or the cache, and each image is written and read once between two convolutions.
//!
//! An image's rows and pixels are shared out among threads in the same parts whatever their number.

use rayon::prelude::*;

use super::architecture::{Architecture, Block};
use super::folded::{Folded, Taps};
use super::squeeze::Squeeze;
use super::tape::tile_pixels;
use crate::kernels::batch_norm::{activate, activate_and_add};
use crate::kernels::buffer::{Buffer, Pool};
use crate::kernels::depthwise::{Window, forward_row};
use crate::kernels::panels::Panels;
use crate::kernels::pointwise::{activated, normalised};
use crate::kernels::stem;

/// Everything that a pass reads.
pub struct Inference<'a> {
    pub architecture: &'a Architecture,
    pub folded: &'a Folded,
    pub parameters: &'a [f32],
    pub pool: &'a Pool,
}

/// An activated image [height, width + 2 padding, channels], zero in the padding.
struct Padded {
    values: Buffer,
    height: usize,
    width: usize,
    row: usize,
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
    pub fn run(&self, images: &[f32], height: usize, width: usize) -> Vec<f32> {
        let images = images.chunks(height * width).collect();
        of_each(images, |_, image| self.image(image, height, width)).concat()
    }

    fn image(&self, image: &[f32], height: usize, width: usize) -> Vec<f32> {
        let columns = width;
        let (mut height, mut width) = (height.div_ceil(2), width.div_ceil(2));
        let mut x = self.pool.take(0);
        for (block, folded) in self.architecture.blocks.iter().zip(&self.folded.blocks) {
            let window = block.window;
            let expanded = match &folded.expand {
                None => self.stem(window, image, columns, height, width),
                Some(panels) => self.expand(window, panels, &x, height, width),
            };
            let (depthwise, pooled) = self.depthwise(window, &folded.depthwise, &expanded);
            (height, width) = (window.output(height), window.output(width));
            let gate = Squeeze::forward(&block.squeeze, self.parameters, pooled).gate;
            x = self.project(block, &folded.project, &depthwise, &gate, &x);
        }
        self.head(&x)
    }

    /// The first convolution, activated [height, width, channels], of an image in rows of `columns`.
    fn stem(
        &self,
        window: Window,
        image: &[f32],
        columns: usize,
        height: usize,
        width: usize,
    ) -> Padded {
        let taps = &self.folded.stem;
        let channels = taps.affine.scale.len();
        self.padded(window, channels, height, width, 8, |first, row, out| {
            let margin = window.padding() * channels;
            let mut raw = self.pool.take(width * channels);
            for (y, out) in out.chunks_exact_mut(row).enumerate() {
                stem::forward_row(image, columns, first + y, &taps.weights, &mut raw);
                activate(&raw, &taps.affine, None, &mut out[margin..row - margin]);
            }
        })
    }

    /// The pointwise convolution at the beginning of a block, activated.
    fn expand(
        &self,
        window: Window,
        panels: &Panels,
        x: &[f32],
        height: usize,
        width: usize,
    ) -> Padded {
        let (channels, columns) = (panels.channels(), panels.columns());
        let rows = tile_pixels(channels + columns).div_ceil(width);
        self.padded(window, channels, height, width, rows, |first, row, out| {
            let input = &x[first * width * columns..][..out.len() / row * width * columns];
            let margin = window.padding() * channels;
            let place = |pixel| pixel / width * row + margin + pixel % width * channels;
            activated(input, panels, place, out);
        })
    }

    /// An image whose rows between their padding `make` writes, `at_once` of them from a first one on, each of so many values.
    fn padded(
        &self,
        window: Window,
        channels: usize,
        height: usize,
        width: usize,
        at_once: usize,
        make: impl Fn(usize, usize, &mut [f32]) + Sync,
    ) -> Padded {
        let margin = window.padding() * channels;
        let row = width * channels + 2 * margin;
        let mut values = self.pool.take(height * row);
        let parts = values.chunks_mut(at_once * row).collect();
        of_each(parts, |number, out: &mut [f32]| {
            for out in out.chunks_exact_mut(row) {
                out[..margin].fill(0.0);
                out[row - margin..].fill(0.0);
            }
            make(number * at_once, row, out);
        });
        Padded {
            values,
            height,
            width,
            row,
        }
    }

    /// The depthwise convolution, activated [pixels, channels], and the mean of each channel.
    fn depthwise(&self, window: Window, taps: &Taps, input: &Padded) -> (Buffer, Vec<f32>) {
        let channels = taps.affine.scale.len();
        let (height, width) = (window.output(input.height), window.output(input.width));
        let zeros = vec![0.0; input.row];
        let row = width * channels;
        let mut out = self.pool.take(height * row);
        let at_once = height.div_ceil(8);
        let parts = out.chunks_mut(at_once * row).collect();
        let parts = of_each(parts, |number, out: &mut [f32]| {
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
                    &taps.weights,
                    channels,
                    &mut raw,
                );
                activate_and_add(&raw, &taps.affine, out, &mut sums);
            }
            sums
        });
        (out, means(&parts, height * width))
    }

    /// The convolution at the end of a block, normalised, with the block's input where it adds it.
    ///
    /// The gates are multiplied into its weights, which are fewer than the pixels' values.
    fn project(
        &self,
        block: &Block,
        panels: &Panels,
        input: &[f32],
        gate: &[f32],
        added: &[f32],
    ) -> Buffer {
        let (channels, columns) = (panels.channels(), panels.columns());
        let gated = panels.gated(gate, self.pool);
        let mut out = self.pool.take(input.len() / columns * channels);
        let tile = tile_pixels(channels + columns);
        let parts = out.chunks_mut(tile * channels).collect();
        of_each(parts, |number, out: &mut [f32]| {
            let start = number * tile;
            let input = &input[start * columns..][..out.len() / channels * columns];
            let added = block
                .residual
                .then(|| &added[start * channels..][..out.len()]);
            normalised(input, &gated, added, out);
        });
        out
    }

    /// The last convolution, activated and averaged over the image.
    fn head(&self, input: &[f32]) -> Vec<f32> {
        let panels = &self.folded.head;
        let (channels, columns) = (panels.channels(), panels.columns());
        let parts = input
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
        means(&parts, input.len() / columns)
    }
}

/// The mean of each channel, from the sums of some parts in their order.
fn means(parts: &[Vec<f64>], pixels: usize) -> Vec<f32> {
    let mean = |c: usize| (parts.iter().map(|sums| sums[c]).sum::<f64>() / pixels as f64) as f32;
    (0..parts[0].len()).map(mean).collect()
}
