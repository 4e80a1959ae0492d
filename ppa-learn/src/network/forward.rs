//! The forward pass in training, layer by layer on channels-last images.
//!
//! The output of a convolution is stored before its normalisation; whatever reads it normalises and activates it on the fly, a tile of pixels or a
//! few rows at a time, so that activated images never go through memory.

mod convolutions;

use std::convert::Infallible;

use rayon::prelude::*;

use super::architecture::{Architecture, Block, ConvKind, ConvPlace};
use super::initialise::gains;
use super::layers::Layers;
use super::norm::Norm;
use super::squeeze::Squeeze;
use super::tape::{BlockTape, Images, Normed, Size, Tape, by_image};
use crate::kernels::batch_norm::{Affine, activate, add_activated, normalise};
use crate::kernels::buffer::Pool;

/// Inputs of a forward pass, the running statistics that it updates, and the values that it keeps.
pub struct Forward<'a> {
    pub architecture: &'a Architecture,
    pub parameters: &'a [f32],
    pub statistics: &'a mut [f32],
    pub pool: &'a Pool,
    /// Weight of the batch in the update of the running statistics.
    pub momentum: f64,
    /// Random numbers for stochastic depth; `None` keeps every branch.
    pub random: Option<&'a mut dyn rand::Rng>,
    /// Tapes of the blocks so far.
    pub blocks: Vec<BlockTape>,
}

/// The first two convolutions of a block.
pub struct Filtered {
    expand: Normed,
    depthwise: Normed,
}

impl Forward<'_> {
    /// Computes the features [images, 1280] of images [images, height, width], and the tape for their gradient.
    pub fn run(mut self, images: &[f32], size: Size) -> (Vec<f32>, Tape) {
        let images = Images::copied(images, size, self.pool);
        let Ok(output) = self.features(self.architecture, images);
        output
    }

    /// Computes a convolution of images of a size, and its normalisation by the batch.
    ///
    /// `convolve` writes the output of the given size and returns its moments.
    fn normed(
        &mut self,
        place: &ConvPlace,
        size: Size,
        convolve: impl FnOnce(&Self, Size, &mut [f32]) -> Vec<f64>,
    ) -> Normed {
        let size = size.after(place.window);
        let mut pixels = self.pool.take(size.count() * place.channels);
        let sums = convolve(self, size, &mut pixels);
        let norm = Norm::batch(
            &place.norm,
            self.parameters,
            self.statistics,
            &sums,
            size.count(),
            self.momentum,
        );
        Normed { pixels, size, norm }
    }
}

impl Layers for Forward<'_> {
    type Image = Images;
    type Filtered = Filtered;
    type Gate = Squeeze;
    type Features = (Vec<f32>, Tape);
    type Error = Infallible;

    fn filter(&mut self, block: &Block, input: &Images) -> Result<Filtered, Infallible> {
        let place = &block.expand;
        let expand = self.normed(place, input.size, |pass, size, out| match place.kind {
            ConvKind::Pointwise => pass.pointwise(place, &input.pixels, size, out),
            ConvKind::Stem | ConvKind::Depthwise => pass.stem(place, input, size, out),
        });
        let place = &block.depthwise;
        let depthwise = self.normed(place, expand.size, |pass, size, out| {
            pass.depthwise(place, &expand, size, out)
        });
        Ok(Filtered { expand, depthwise })
    }

    fn squeeze(&mut self, block: &Block, filtered: &Filtered) -> Result<Squeeze, Infallible> {
        let pooled = pooled(&filtered.depthwise);
        Ok(Squeeze::forward(&block.squeeze, self.parameters, pooled))
    }

    fn project(
        &mut self,
        block: &Block,
        filtered: Filtered,
        squeeze: Squeeze,
        input: Images,
    ) -> Result<Images, Infallible> {
        let Filtered { expand, depthwise } = filtered;
        let place = &block.project;
        let project = self.normed(place, depthwise.size, |pass, size, out| {
            pass.project(place, &depthwise, &squeeze.gate, size, out)
        });
        let size = project.size;
        let gains = match &mut self.random {
            Some(random) if block.residual => gains(random, size.images, block.drop),
            _ => vec![1.0; size.images],
        };
        let mut pixels = self.pool.take(project.pixels.len());
        let per_image = size.pixels() * place.channels;
        pixels
            .par_chunks_mut(per_image)
            .zip(project.pixels.par_chunks(per_image))
            .enumerate()
            .for_each(|(image, (out, pixels))| {
                let added = block
                    .residual
                    .then(|| &input.pixels[image * per_image..][..per_image]);
                normalise(pixels, &project.norm.affine, gains[image], added, out);
            });
        self.blocks.push(BlockTape {
            input,
            expand,
            depthwise,
            squeeze,
            project,
            gains,
        });
        Ok(Images { pixels, size })
    }

    fn head(&mut self, place: &ConvPlace, input: Images) -> Result<Self::Features, Infallible> {
        let head = self.normed(place, input.size, |pass, size, out| {
            pass.pointwise(place, &input.pixels, size, out)
        });
        let features = pooled(&head);
        let tape = Tape {
            blocks: std::mem::take(&mut self.blocks),
            head_input: input,
            head,
        };
        Ok((features, tape))
    }
}

/// Writes the activated pixels of a run times the gates of their image.
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

/// Adds up the tasks' sums, in the order of the tasks.
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

/// Returns the mean of each activated channel over each image: [images, channels].
fn pooled(input: &Normed) -> Vec<f32> {
    let size = input.size;
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
