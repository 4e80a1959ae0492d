//! Depth images on the page, and strips of pictures.

use image::{Rgb, RgbImage};
use ppa_dataset::manifest::RoiRow;
use ppa_dataset::published::GrayImage16;
use ppa_depth::false_colour;

use crate::drawing::{INK, draw_circle, fill_disc};

/// A whole depth image in false colour over a range of depths, mm, with its region of interest framed and the joint marked by a dot in
/// a ring.
pub(super) fn depth_view(
    image: &GrayImage16,
    range_mm: [f64; 2],
    roi: Option<&RoiRow>,
    joint: Option<[f64; 2]>,
) -> RgbImage {
    let pixel = |x: u32, y: u32| image.pixels[(y * image.width + x) as usize];
    let mut view = RgbImage::from_fn(image.width, image.height, |x, y| {
        Rgb(false_colour(pixel(x, y).into(), range_mm))
    });
    if let Some(roi) = roi {
        frame(&mut view, roi);
    }
    if let Some(joint) = joint {
        fill_disc(&mut view, joint, 2.0, INK);
        draw_circle(&mut view, joint, 7.0, 2.0, INK);
    }
    view
}

/// Whether a column or row is within a region that starts at `start`.
fn within(at: u32, start: u32, roi: &RoiRow) -> bool {
    (start..start.saturating_add(roi.size)).contains(&at)
}

/// Draws the border of a region, two pixels wide, as far as it is in the image.
fn frame(view: &mut RgbImage, roi: &RoiRow) {
    let on_edge = |at: u32, start: u32| {
        let far = start.saturating_add(roi.size).saturating_sub(2);
        at < start.saturating_add(2) || at >= far
    };
    for (x, y, pixel) in view.enumerate_pixels_mut() {
        let inside = within(x, roi.x_start, roi) && within(y, roi.y_start, roi);
        if inside && (on_edge(x, roi.x_start) || on_edge(y, roi.y_start)) {
            *pixel = INK;
        }
    }
}

/// Pictures side by side, each centred in a part of the same width.
pub(super) fn strip(pictures: &[RgbImage]) -> RgbImage {
    const GAP: u32 = 6;
    let [width, height] = pictures.iter().fold([0, 0], |[width, height], one| {
        [width.max(one.width() + GAP), height.max(one.height())]
    });
    let mut strip = RgbImage::from_pixel(width * pictures.len() as u32, height, Rgb([255; 3]));
    for (place, picture) in (0_i64..).zip(pictures) {
        let x = place * i64::from(width) + i64::from(GAP / 2);
        image::imageops::replace(&mut strip, picture, x, 0);
    }
    strip
}

#[cfg(test)]
mod tests {
    use ppa_dataset::layout::View;

    use super::*;

    #[test]
    fn region_and_joint_are_drawn_where_they_are() {
        let image = GrayImage16 {
            width: 40,
            height: 30,
            pixels: vec![900; 1200],
        };
        let roi = RoiRow {
            camera: View::Left,
            image_number: 0,
            x_start: 30,
            y_start: 4,
            size: 14,
        };
        let view = depth_view(&image, [800.0, 1000.0], Some(&roi), Some([15.0, 20.0]));
        let is_ink = |x, y| *view.get_pixel(x, y) == INK;
        assert!(
            is_ink(30, 4) && is_ink(35, 4) && is_ink(31, 17) && is_ink(39, 5),
            "the frame reaches the border"
        );
        assert!(!is_ink(29, 4) && !is_ink(34, 8) && !is_ink(35, 18));
        assert!(is_ink(15, 20) && is_ink(22, 20) && !is_ink(19, 20));
    }
}
