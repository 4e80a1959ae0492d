//! The forward pass, layer by layer on channels-last images.
//!
//! A convolution is kept before its normalisation; whoever reads it normalises and activates it on the way, a tile of
//! pixels or a few rows at a time, so that activated images never go through memory.

use rayon::prelude::*;

use super::architecture::{Architecture, Block, ConvPlace};
use super::initialise::gains;
use super::norm::Norm;
use super::squeeze::Squeeze;
use super::tape::{BlockTape, Normed, Size, Tape, by_image, tile_pixels};
use crate::kernels::batch_norm::{Affine, activate, add_activated, add_moments, normalise};
use crate::kernels::buffer::{Buffer, Pool};
use crate::kernels::depthwise::{Rows, Window, channels_last, forward_row};
use crate::kernels::matrix::{Matrix, Store, multiply};
use crate::kernels::stem;

/// Whether a pass normalises by the batch, and from which random numbers it leaves out branches.
pub enum Pass<'a> {
    Train(&'a mut dyn rand::Rng),
    Eval,
}

/// Everything that a pass reads, and the running statistics that it moves.
pub struct Forward<'a> {
    pub architecture: &'a Architecture,
    pub parameters: &'a [f32],
    pub statistics: &'a mut [f32],
    pub pool: &'a Pool,
    pub pass: Pass<'a>,
}

impl Forward<'_> {
    /// Features [images, 1280] of images [images, height, width], and in training what their gradient needs.
    pub fn run(mut self, images: &[f32], image_size: Size) -> (Vec<f32>, Option<Tape>) {
        let architecture = self.architecture;
        let mut tapes = Vec::new();
        let mut input = self.pool.take(images.len());
        input.copy_from_slice(images);
        let mut size = image_size;
        for (index, block) in architecture.blocks.iter().enumerate() {
            let (output, tape) = self.block(block, index == 0, input, size);
            size = tape.size_out;
            input = output;
            if matches!(self.pass, Pass::Train(_)) {
                tapes.push(tape);
            }
        }
        let place = &architecture.head;
        let mut pixels = self.pool.take(size.count() * place.channels);
        let sums = self.pointwise(place, &input, size, &mut pixels);
        let head = self.normed(place, pixels, &sums, size);
        let features = pooled(&head, size);
        let tape = Tape {
            image_size,
            blocks: tapes,
            head_input: input,
            head_size: size,
            head,
        };
        (
            features,
            matches!(self.pass, Pass::Train(_)).then_some(tape),
        )
    }

    /// Output of a block, and its tape.
    fn block(
        &mut self,
        block: &Block,
        first: bool,
        input: Buffer,
        size: Size,
    ) -> (Buffer, BlockTape) {
        let place = &block.expand;
        let size_in = if first {
            Size {
                height: size.height.div_ceil(2),
                width: size.width.div_ceil(2),
                ..size
            }
        } else {
            size
        };
        let mut pixels = self.pool.take(size_in.count() * place.channels);
        let sums = if first {
            self.stem(place, &input, size, size_in, &mut pixels)
        } else {
            self.pointwise(place, &input, size, &mut pixels)
        };
        let expand = self.normed(place, pixels, &sums, size_in);

        let (place, window) = (&block.depthwise, block.window);
        let (height, width) = (window.output(size_in.height), window.output(size_in.width));
        let size_out = Size {
            height,
            width,
            ..size
        };
        let mut pixels = self.pool.take(size_out.count() * place.channels);
        let sums = self.depthwise(place, window, &expand, size_in, size_out, &mut pixels);
        let depthwise = self.normed(place, pixels, &sums, size_out);
        let squeeze = Squeeze::forward(
            &block.squeeze,
            self.parameters,
            pooled(&depthwise, size_out),
        );

        let place = &block.project;
        let mut pixels = self.pool.take(size_out.count() * place.channels);
        let sums = self.project(place, &depthwise, &squeeze.gate, size_out, &mut pixels);
        let project = self.normed(place, pixels, &sums, size_out);

        let gains = match &mut self.pass {
            Pass::Train(random) if block.residual => gains(random, size.images, block.drop),
            _ => vec![1.0; size.images],
        };
        let mut output = self.pool.take(project.pixels.len());
        let per_image = size_out.pixels() * place.channels;
        output
            .par_chunks_mut(per_image)
            .zip(project.pixels.par_chunks(per_image))
            .enumerate()
            .for_each(|(image, (out, pixels))| {
                let added = block
                    .residual
                    .then(|| &input[image * per_image..][..per_image]);
                normalise(pixels, &project.norm.affine, gains[image], added, out);
            });
        let tape = BlockTape {
            input,
            size_in,
            size_out,
            expand,
            depthwise,
            squeeze,
            project,
            gains,
        };
        (output, tape)
    }

    /// The normalisation of a convolution, by the batch in training.
    fn normed(&mut self, place: &ConvPlace, pixels: Buffer, sums: &[f64], size: Size) -> Normed {
        let norm = match self.pass {
            Pass::Train(_) => Norm::batch(
                &place.norm,
                self.parameters,
                self.statistics,
                sums,
                size.count(),
            ),
            Pass::Eval => Norm::running(&place.norm, self.parameters, self.statistics),
        };
        Normed { pixels, norm }
    }

    /// What moments are taken about; nothing where none are needed.
    fn center(&self, place: &ConvPlace) -> Option<&[f32]> {
        matches!(self.pass, Pass::Train(_)).then(|| &self.statistics[place.norm.mean.clone()])
    }

    fn stem(
        &self,
        place: &ConvPlace,
        images: &[f32],
        size: Size,
        size_out: Size,
        out: &mut [f32],
    ) -> Vec<f64> {
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
                    moments(out, center, &mut sums);
                }
            }
            sums
        }))
    }

    fn pointwise(&self, place: &ConvPlace, input: &[f32], size: Size, out: &mut [f32]) -> Vec<f64> {
        let channels = place.channels;
        let weight = &self.parameters[place.weight.clone()];
        let columns = weight.len() / channels;
        let center = self.center(place);
        let task = size.pixels_per_task();
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
                multiply(
                    out,
                    Matrix::new(input, columns),
                    Matrix::new(weight, columns).transposed(),
                    Store::Replace,
                );
                moments(out, center, &mut sums);
            }
            sums
        }))
    }

    fn depthwise(
        &self,
        place: &ConvPlace,
        window: Window,
        input: &Normed,
        size: Size,
        size_out: Size,
        out: &mut [f32],
    ) -> Vec<f64> {
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
            let mut memory = self
                .pool
                .take(Rows::len(kernel, size.width, padding, channels));
            for (out, pixels) in out
                .chunks_mut(size_out.height * row_out)
                .zip(pixels.chunks(size.height * row))
            {
                let mut rows = Rows::new(
                    &mut memory,
                    kernel,
                    size.height,
                    size.width,
                    padding,
                    channels,
                );
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
                    moments(out, center, &mut sums);
                }
            }
            sums
        }))
    }

    fn project(
        &self,
        place: &ConvPlace,
        input: &Normed,
        gates: &[f32],
        size: Size,
        out: &mut [f32],
    ) -> Vec<f64> {
        let channels = place.channels;
        let weight = &self.parameters[place.weight.clone()];
        let columns = weight.len() / channels;
        let center = self.center(place);
        let task = size.pixels_per_task();
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
                multiply(
                    out,
                    Matrix::new(active, columns),
                    Matrix::new(weight, columns).transposed(),
                    Store::Replace,
                );
                moments(out, center, &mut sums);
            }
            sums
        }))
    }
}

/// Activated pixels of a run times the gates of their image.
pub fn gated(
    pixels: &[f32],
    affine: &Affine,
    gates: &[f32],
    size: Size,
    run: std::ops::Range<usize>,
    out: &mut [f32],
) {
    let channels = affine.scale.len();
    let pixels = &pixels[run.start * channels..run.end * channels];
    for (image, part) in by_image(run, size) {
        let part = part.start * channels..part.end * channels;
        let gate = &gates[image * channels..][..channels];
        activate(&pixels[part.clone()], affine, Some(gate), &mut out[part]);
    }
}

fn moments(pixels: &[f32], center: Option<&[f32]>, sums: &mut [f64]) {
    if let Some(center) = center {
        add_moments(pixels, center, sums);
    }
}

/// The sum of the tasks' sums, in the order of the tasks.
pub fn total<T: std::ops::AddAssign + Send>(
    parts: impl IndexedParallelIterator<Item = Vec<T>>,
) -> Vec<T> {
    let parts: Vec<Vec<T>> = parts.collect();
    let mut parts = parts.into_iter();
    let mut sum = parts.next().unwrap_or_default();
    for part in parts {
        for (sum, part) in sum.iter_mut().zip(part) {
            *sum += part;
        }
    }
    sum
}

/// Mean of each activated channel over each image: [images, channels].
fn pooled(input: &Normed, size: Size) -> Vec<f32> {
    let channels = input.norm.mean.len();
    let images = input.pixels.par_chunks(size.pixels() * channels);
    images
        .flat_map_iter(|pixels| {
            let mut sums = vec![0.0; channels];
            for part in pixels.chunks(256 * channels) {
                add_activated(part, &input.norm.affine, &mut sums);
            }
            sums.into_iter()
                .map(|sum| (sum / size.pixels() as f64) as f32)
        })
        .collect()
}
