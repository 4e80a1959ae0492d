//! Depth edges, where Time-of-Flight cameras lose pixels.

use super::blur::mirrored;
use super::raster::Raster;

/// Returns the larger absolute value of the two 3 x 3 Sobel derivatives; the image is mirrored about its outermost pixels.
///
/// # Panics
/// If the image has fewer than 2 columns or rows.
pub fn gradient(image: &Raster<f32>) -> Raster<f64> {
    let (width, height) = (image.width(), image.height());
    assert!(width.min(height) >= 2, "a derivative needs two pixels");
    let mut smoothed = vec![0.0; width];
    let mut difference = vec![0.0; width];
    image.map_rows(|y, values| {
        let [above, here, below] = [0, 1, 2].map(|row| image.row(mirrored(y + row, 1, height)));
        for x in 0..width {
            let [above, here, below] = [above[x], here[x], below[x]].map(f64::from);
            smoothed[x] = above + 2.0 * here + below;
            difference[x] = below - above;
        }
        values.extend((0..width).map(|x| {
            let (left, right) = (mirrored(x, 1, width), mirrored(x + 2, 1, width));
            let across = smoothed[right] - smoothed[left];
            let down = difference[left] + 2.0 * difference[x] + difference[right];
            across.abs().max(down.abs())
        }));
    })
}

/// Returns the `share` quantile of `numbers`, with linear interpolation between the two nearest ranks.
///
/// # Panics
/// If there are no numbers, or `share` is not in [0, 1].
pub fn quantile(numbers: &[f64], share: f64) -> f64 {
    assert!((0.0..=1.0).contains(&share), "a share lies in [0, 1]");
    let place = share * (numbers.len() - 1) as f64;
    let mut numbers = numbers.to_vec();
    let (_, &mut lower, above) =
        numbers.select_nth_unstable_by(place.floor() as usize, f64::total_cmp);
    let upper = above
        .iter()
        .copied()
        .min_by(f64::total_cmp)
        .unwrap_or(lower);
    lower + (upper - lower) * place.fract()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_by_hand() {
        let numbers = [4.0, 1.0, 3.0, 2.0];
        let found = [0.0, 0.5, 0.75, 1.0].map(|share| quantile(&numbers, share));
        assert_eq!(found, [1.0, 2.5, 3.25, 4.0]);
    }
}
