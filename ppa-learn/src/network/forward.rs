//! The forward pass of training, layer by layer on channels-last images.
//!
//! A convolution is kept before its normalisation; whoever reads it normalises and activates it on the way, a tile of
//! pixels or a few rows at a time, so that activated images never go through memory.

mod convolutions;

use rayon::prelude::*;

use super::architecture::{Architecture, Block, ConvPlace};
use super::initialise::gains;
use super::norm::Norm;
use super::squeeze::Squeeze;
use super::tape::{BlockTape, Normed, Size, Tape, by_image};
use crate::kernels::batch_norm::{Affine, activate, add_activated, normalise};
use crate::kernels::buffer::{Buffer, Pool};

/// Everything that a pass reads, and the running statistics that it moves.
pub struct Forward<'a> {
    pub architecture: &'a Architecture,
    pub parameters: &'a [f32],
    pub statistics: &'a mut [f32],
    pub pool: &'a Pool,
    /// Tells which branches are left out.
    pub random: &'a mut dyn rand::Rng,
}

impl Forward<'_> {
    /// Features [images, 1280] of images [images, height, width], and what their gradient needs.
    pub fn run(mut self, images: &[f32], image_size: Size) -> (Vec<f32>, Tape) {
        let architecture = self.architecture;
        let mut tapes = Vec::new();
        let mut input = self.pool.take(images.len());
        input.copy_from_slice(images);
        let mut size = image_size;
        for (index, block) in architecture.blocks.iter().enumerate() {
            let (output, tape) = self.block(block, index == 0, input, size);
            size = tape.size_out;
            input = output;
            tapes.push(tape);
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
        (features, tape)
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

        let gains = match block.residual {
            true => gains(&mut self.random, size.images, block.drop),
            false => vec![1.0; size.images],
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

    /// The normalisation of a convolution by the batch.
    fn normed(&mut self, place: &ConvPlace, pixels: Buffer, sums: &[f64], size: Size) -> Normed {
        let norm = Norm::batch(
            &place.norm,
            self.parameters,
            self.statistics,
            sums,
            size.count(),
        );
        Normed { pixels, norm }
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
