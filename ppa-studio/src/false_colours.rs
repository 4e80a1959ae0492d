//! Depth images in false colour, side by side.

use image::{Rgb, RgbImage};
use ppa_dataset::published::GrayImage16;
use ppa_depth::{DepthImage, false_colour};

/// Depth range of the colours, mm: enough for a limb on its table.
const COLOURED_MM: f64 = 350.0;

/// Image of depths in row order.
pub(crate) trait Depths {
    fn size(&self) -> [u32; 2];

    /// Returns the depth of a pixel, mm; 0 if there is none.
    fn depth_mm(&self, pixel: usize) -> f64;
}

impl Depths for &DepthImage {
    fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    fn depth_mm(&self, pixel: usize) -> f64 {
        f64::from(self.z_mm[pixel])
    }
}

impl Depths for GrayImage16 {
    fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    fn depth_mm(&self, pixel: usize) -> f64 {
        f64::from(self.pixels[pixel])
    }
}

/// Returns all images in one picture, the first at the left, and the depth range of its colours, mm, which begins at the nearest depth.
pub(crate) fn side_by_side(images: &[impl Depths]) -> (RgbImage, [f64; 2]) {
    let range_mm = range_mm(images);
    let sizes = images.iter().map(Depths::size);
    let [width, height] = sizes.fold([0, 0], |[w, h], size| [w + size[0], h.max(size[1])]);
    let mut picture = RgbImage::new(width, height);
    let mut left = 0;
    for image in images {
        let [width, height] = image.size();
        for y in 0..height {
            for x in 0..width {
                let z_mm = image.depth_mm((y * width + x) as usize);
                if z_mm > 0.0 {
                    picture.put_pixel(left + x, y, Rgb(false_colour(z_mm, range_mm)));
                }
            }
        }
        left += width;
    }
    (picture, range_mm)
}

fn range_mm(images: &[impl Depths]) -> [f64; 2] {
    let pixels = |image: &_| {
        let [width, height] = Depths::size(image);
        0..(width as usize * height as usize)
    };
    let near = images
        .iter()
        .flat_map(|image| pixels(image).map(|pixel| image.depth_mm(pixel)))
        .filter(|z_mm| *z_mm > 0.0)
        .fold(f64::INFINITY, f64::min);
    let near = if near.is_finite() { near } else { 0.0 };
    [near, near + COLOURED_MM]
}
