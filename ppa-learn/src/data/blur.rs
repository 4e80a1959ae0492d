//! Box filter.

use super::raster::Raster;

/// Averages over the square of `side` x `side` pixels around each pixel; the image is mirrored about its outermost pixels.
///
/// # Panics
/// If `side` is even, or the image has fewer than `side` columns or rows.
pub fn box_blur(image: &Raster<f32>, side: usize) -> Raster<f32> {
    assert!(side % 2 == 1, "a box has a pixel in its middle");
    let (width, height) = (image.width(), image.height());
    assert!(side <= width.min(height), "the box fits into the image");
    let radius = side / 2;
    let mut padded = vec![0.0; width + 2 * radius];
    let sums = image.map_rows(|y, values| {
        for (i, value) in padded.iter_mut().enumerate() {
            *value = image.row(y)[mirrored(i, radius, width)];
        }
        let start = values.len();
        values.resize(start + width, 0.0);
        for shift in 0..side {
            add(&mut values[start..], &padded[shift..]);
        }
    });
    let scale = 1.0 / (side * side) as f32;
    image.map_rows(|y, values| {
        let start = values.len();
        values.resize(start + width, 0.0);
        for shift in 0..side {
            add(
                &mut values[start..],
                sums.row(mirrored(y + shift, radius, height)),
            );
        }
        for value in &mut values[start..] {
            *value *= scale;
        }
    })
}

/// Returns the source index of element `i` of a row that is extended by `radius` mirrored elements at both ends.
pub(super) fn mirrored(i: usize, radius: usize, length: usize) -> usize {
    let place = i.abs_diff(radius);
    let last = length - 1;
    last - place.abs_diff(last).min(last)
}

fn add(sums: &mut [f32], values: &[f32]) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += value;
    }
}

#[cfg(test)]
mod tests {
    use super::mirrored;

    #[test]
    fn the_outermost_pixel_is_not_repeated() {
        let places: Vec<usize> = (0..9).map(|i| mirrored(i, 2, 5)).collect();
        assert_eq!(places, [2, 1, 0, 1, 2, 3, 4, 3, 2]);
    }
}
