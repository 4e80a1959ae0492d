//! Inference: the normalisations are known beforehand, so a convolution's output is normalised, activated and pooled while it is in
//! registers or the cache. An expanded image is never stored completely: its rows are computed when the depthwise convolution
//! needs them.
//!
//! The result for a row or pixel does not depend on the division among threads, and sums of rows are added in their order.

use std::convert::Infallible;
use std::ops::Range;

use rayon::prelude::*;

use super::architecture::{Architecture, Block, ConvKind, ConvPlace};
use super::folded::Folded;
use super::layers::Layers;
use super::squeeze::Squeeze;
use super::tape::{Images, Size, tile_pixels};
use crate::kernels::buffer::Pool;
use crate::kernels::filter::filter_rows;
use crate::kernels::panel_rows::PanelRows;
use crate::kernels::pointwise::{activated, activated_rows, normalised};
use crate::kernels::stem;

/// Inputs of a pass.
#[derive(Clone, Copy)]
pub struct Inference<'a> {
    pub architecture: &'a Architecture,
    pub folded: &'a Folded,
    pub parameters: &'a [f32],
    pub pool: &'a Pool,
}

/// The activated output of a depthwise convolution, and the mean of each channel.
pub struct Filtered {
    image: Images,
    pooled: Vec<f32>,
}

/// Returns the results of `work` for each part, in order. Without other threads it runs in place: waking one costs more than a part.
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
    /// Computes the features [images, 1280] of images [images, height, width].
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

    /// Computes some output rows of the stem or of the expansion of a block.
    fn expand(&self, block: &Block, input: &Images, rows: Range<usize>, out: &mut PanelRows) {
        let panels = &self.folded.blocks[block.number].expand;
        let width = block.expand.window.output(input.size.width);
        let row = width * panels.columns();
        if block.expand.kind == ConvKind::Stem {
            let mut neighbours = self.pool.take(rows.len() * row);
            for (y, neighbours) in rows.clone().zip(neighbours.chunks_exact_mut(row)) {
                stem::neighbours_of_row(&input.pixels, input.size.width, y, neighbours);
            }
            activated_rows(&neighbours, panels, width, rows.start, out);
        } else {
            let input = &input.pixels[rows.start * row..rows.end * row];
            activated_rows(input, panels, width, rows.start, out);
        }
    }

    /// Computes rows of a block's depthwise convolution from `first` on, [rows, width, channels], and their sums [rows, channels].
    fn filter_part(
        &self,
        block: &Block,
        input: &Images,
        first: usize,
        out: &mut [f32],
        sums: &mut [f32],
    ) {
        let taps = &self.folded.blocks[block.number].depthwise;
        let (channels, window) = (block.depthwise.channels, block.depthwise.window);
        let expanded = input.size.after(block.expand.window);
        let count = sums.len() / channels;
        let row = out.len() / count;
        // The expanded row at the top of the kernel, and the one after its bottom.
        let top = |y: usize| ((first + y) * window.stride) as isize - window.padding() as isize;
        let end = |y: usize| (top(y) + window.kernel as isize).cast_unsigned();
        let last = end(count - 1).min(expanded.height);

        let at_once = tile_pixels(channels).div_ceil(expanded.width);
        let room = expanded.height.min(at_once + window.kernel - 1);
        let shape = [expanded.height, expanded.width];
        let mut rows = PanelRows::new(self.pool, room, shape, window.padding(), channels);
        let (mut next, mut done) = (top(0).max(0).cast_unsigned(), 0);
        while done < count {
            let until = last.min(next + at_once);
            self.expand(block, input, next..until, &mut rows);
            next = until;
            let ready = (done..count)
                .take_while(|&y| end(y).min(last) <= next)
                .count();
            if ready > 0 {
                let out = &mut out[done * row..][..ready * row];
                let sums = &mut sums[done * channels..][..ready * channels];
                filter_rows(taps, &rows, top(done), out, sums);
                done += ready;
            }
        }
    }
}

impl Layers for Inference<'_> {
    type Image = Images;
    type Filtered = Filtered;
    type Gate = Vec<f32>;
    type Features = Vec<f32>;
    type Error = Infallible;

    fn filter(&mut self, block: &Block, input: &Images) -> Result<Filtered, Infallible> {
        let (channels, window) = (block.depthwise.channels, block.depthwise.window);
        let size = input.size.after(block.expand.window).after(window);
        let row = size.width * channels;
        let mut pixels = self.pool.take(size.height * row);
        let mut sums = self.pool.take(size.height * channels);
        // Rows needed by two parts are expanded twice: at most a fifth of the rows.
        let least = 4 * window.kernel;
        let task = (size.height.div_ceil(rayon::current_num_threads())).max(least);
        let parts = pixels.chunks_mut(task * row);
        let parts = parts.zip(sums.chunks_mut(task * channels)).collect();
        of_each(parts, |number, (out, sums): (&mut [f32], &mut [f32])| {
            self.filter_part(block, input, number * task, out, sums);
        });
        Ok(Filtered {
            image: Images { pixels, size },
            pooled: means(&sums, channels, size.pixels()),
        })
    }

    fn squeeze(&mut self, block: &Block, filtered: &Filtered) -> Result<Vec<f32>, Infallible> {
        let pooled = filtered.pooled.clone();
        Ok(Squeeze::forward(&block.squeeze, self.parameters, pooled).gate)
    }

    /// Multiplies the gates into the weights, or into the pixels if these have fewer values.
    fn project(
        &mut self,
        block: &Block,
        filtered: Filtered,
        gate: Vec<f32>,
        added: Images,
    ) -> Result<Images, Infallible> {
        let panels = &self.folded.blocks[block.number].project;
        let (channels, columns) = (panels.channels(), panels.columns());
        let (mut input, size) = (filtered.image.pixels, filtered.image.size);
        let gated = (size.pixels() >= channels).then(|| panels.gated(&gate, self.pool));
        if gated.is_none() {
            for pixel in input.chunks_exact_mut(columns) {
                pixel.iter_mut().zip(&gate).for_each(|(x, gate)| *x *= gate);
            }
        }
        let panels = gated.as_ref().unwrap_or(panels);
        let mut pixels = self.pool.take(size.pixels() * channels);
        let tile = tile_pixels(channels + columns);
        let parts = pixels.chunks_mut(tile * channels).collect();
        of_each(parts, |number, out: &mut [f32]| {
            let start = number * tile;
            let input = &input[start * columns..][..out.len() / channels * columns];
            let added = block
                .residual
                .then(|| &added.pixels[start * channels..][..out.len()]);
            normalised(input, panels, added, out);
        });
        Ok(Images { pixels, size })
    }

    fn head(&mut self, _: &ConvPlace, input: Images) -> Result<Vec<f32>, Infallible> {
        let panels = &self.folded.head;
        let (channels, columns) = (panels.channels(), panels.columns());
        let tile = tile_pixels(channels + columns);
        let mut active = self.pool.take(input.size.pixels() * channels);
        let parts = active.chunks_mut(tile * channels);
        let parts = parts.zip(input.pixels.chunks(tile * columns)).collect();
        of_each(parts, |_, (out, input): (&mut [f32], &[f32])| {
            activated(input, panels, out);
        });
        Ok(means(&active, channels, input.size.pixels()))
    }
}

/// Returns the mean of each channel over `pixels` pixels, from partial sums [sums, channels].
fn means(sums: &[f32], channels: usize, pixels: usize) -> Vec<f32> {
    let mut total = vec![0.0; channels];
    for sums in sums.chunks_exact(channels) {
        for (total, sum) in total.iter_mut().zip(sums) {
            *total += f64::from(*sum);
        }
    }
    let mean = |sum: &f64| (sum / pixels as f64) as f32;
    total.iter().map(mean).collect()
}
