//! Values of a forward pass that the backward pass needs.

use std::ops::Range;

use super::norm::Norm;
use super::squeeze::Squeeze;
use crate::kernels::buffer::{Buffer, Pool};
use crate::kernels::depthwise::Window;

/// Number of images, and their rows and columns, at one point in the network.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    pub images: usize,
    pub height: usize,
    pub width: usize,
}

impl Size {
    /// Returns the number of pixels of one image.
    pub fn pixels(self) -> usize {
        self.height * self.width
    }

    /// Returns the number of pixels of all images.
    pub fn count(self) -> usize {
        self.images * self.pixels()
    }

    /// Returns the size after a convolution.
    pub fn after(self, window: Window) -> Self {
        Self {
            images: self.images,
            height: window.output(self.height),
            width: window.output(self.width),
        }
    }

    /// Returns the number of images per task: the batch in eight parts for any number of threads, so that sums are reproducible.
    pub fn images_per_task(self) -> usize {
        self.images.div_ceil(8)
    }

    /// Returns the number of images per task for products with a weight matrix: more if eight parts would have fewer than 64 pixels each,
    /// because each product reads all weights.
    pub fn images_per_product(self) -> usize {
        let least = MIN_PIXELS.div_ceil(self.pixels());
        self.images_per_task().max(least.min(self.images))
    }

    /// Returns the number of pixels per task in products with weights.
    pub fn pixels_per_product(self) -> usize {
        self.images_per_product() * self.pixels()
    }
}

/// Minimum number of pixels of a product with weights, except for the last product of a batch.
const MIN_PIXELS: usize = 64;

/// Returns the number of pixels processed at once, such that their values stay in the second-level cache (512 KiB).
pub fn tile_pixels(values_per_pixel: usize) -> usize {
    (131_072 / values_per_pixel).max(64)
}

/// Splits a run of pixels by image into (image, pixels counted from the start of the run).
pub fn by_image(run: Range<usize>, size: Size) -> impl Iterator<Item = (usize, Range<usize>)> {
    let mut at = run.start;
    std::iter::from_fn(move || {
        let image = at / size.pixels();
        let end = ((image + 1) * size.pixels()).min(run.end);
        let part = at - run.start..end - run.start;
        at = end;
        (!part.is_empty()).then_some((image, part))
    })
}

/// Channels-last images.
#[derive(Debug)]
pub struct Images {
    pub pixels: Buffer,
    pub size: Size,
}

impl Images {
    /// Copies images of one channel.
    pub fn copied(images: &[f32], size: Size, pool: &Pool) -> Self {
        let mut pixels = pool.take(images.len());
        pixels.copy_from_slice(images);
        Self { pixels, size }
    }
}

/// A convolution's output before its normalisation, and the normalisation.
#[derive(Debug)]
pub struct Normed {
    pub pixels: Buffer,
    pub size: Size,
    pub norm: Norm,
}

/// One block: its input, its three convolutions, its gates and the gains of stochastic depth.
#[derive(Debug)]
pub struct BlockTape {
    pub input: Images,
    pub expand: Normed,
    pub depthwise: Normed,
    pub squeeze: Squeeze,
    pub project: Normed,
    pub gains: Vec<f32>,
}

/// Values of a complete pass.
#[derive(Debug)]
pub struct Tape {
    pub blocks: Vec<BlockTape>,
    pub head_input: Images,
    pub head: Normed,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_take_at_least_64_pixels_where_there_are_so_many() {
        for (images, side, expected) in [
            (16, 11, 2),
            (32, 6, 4),
            (32, 2, 16),
            (100, 1, 64),
            (3, 1, 3),
        ] {
            let size = Size {
                images,
                height: side,
                width: side,
            };
            assert_eq!(size.images_per_product(), expected, "{size:?}");
        }
    }
}
