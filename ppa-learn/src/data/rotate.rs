//! Rotation about the centre of an image.

use super::raster::Raster;

/// Number of fractional bits of a source coordinate.
const COORDINATE_BITS: u32 = 10;
/// Number of fractional bits of an interpolation weight.
const SHARE_BITS: u32 = 5;

/// Rotates the image counter-clockwise by `degrees` about its centre, with bilinear interpolation and replicated borders.
///
/// The same as `warpAffine` of OpenCV 4.8, with which the published training ran: source coordinates are sums of multiples of
/// 1/1024 pixel, rounded to 1/32 of a pixel. (OpenCV 5 computes them in floating point.)
pub fn rotate(image: &Raster<f32>, degrees: f64) -> Raster<f32> {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let (width, height) = (image.width(), image.height());
    let (cx, cy) = (width as f64 / 2.0 - 0.5, height as f64 / 2.0 - 0.5);
    let fixed = |pixels: f64| (pixels * f64::from(1 << COORDINATE_BITS)).round_ties_even() as i64;
    // Source of pixel (x, y): its rotation by −degrees about (cx, cy).
    let along_row: Vec<[i64; 2]> = (0..width)
        .map(|x| [fixed(cos * x as f64), fixed(sin * x as f64)])
        .collect();
    let start_of_row = |y: usize| {
        let y = y as f64;
        [
            fixed(-sin * y + (cx - cos * cx + sin * cy)),
            fixed(cos * y + (cy - sin * cx - cos * cy)),
        ]
    };
    let clamped_row = |y: i64| image.row(y.clamp(0, height as i64 - 1) as usize);
    let last = width as i64 - 1;
    image.map_rows(|y, values| {
        let start = start_of_row(y);
        values.extend(along_row.iter().map(|along| {
            let [(x, fx), (y, fy)] = [0, 1].map(|axis| split(start[axis] + along[axis]));
            let (x0, x1) = (x.clamp(0, last) as usize, (x + 1).clamp(0, last) as usize);
            let (above, below) = (clamped_row(y), clamped_row(y + 1));
            above[x0] * ((1.0 - fy) * (1.0 - fx))
                + above[x1] * ((1.0 - fy) * fx)
                + below[x0] * (fy * (1.0 - fx))
                + below[x1] * (fy * fx)
        }));
    })
}

/// Splits a fixed-point coordinate into whole pixels and the weight of the next pixel.
fn split(fixed: i64) -> (i64, f32) {
    let drop = COORDINATE_BITS - SHARE_BITS;
    let rounded = (fixed + (1 << (drop - 1))) >> drop;
    let share = rounded & ((1 << SHARE_BITS) - 1);
    (
        rounded >> SHARE_BITS,
        share as f32 / (1 << SHARE_BITS) as f32,
    )
}
