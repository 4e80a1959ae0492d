//! Loss of pixels at depth edges of training images.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::gradient::{gradient, quantile};
use super::raster::Raster;

/// Only pixels whose gradient is above this quantile of the image's gradients may lose their depth.
const EDGE_QUANTILE: f64 = 0.998;
/// Bounds of the share of these pixels that lose their depth.
const LOST_SHARE: [f64; 2] = [0.1, 0.5];

/// Sets pixels to 0 that are drawn with replacement from those at depth edges.
pub fn lose_edge_pixels(image: &mut Raster<f32>, random: &mut ChaCha8Rng) {
    let gradient = gradient(image);
    let threshold = quantile(gradient.values(), EDGE_QUANTILE);
    let edges: Vec<usize> = (0..gradient.values().len())
        .filter(|&place| gradient.values()[place] > threshold)
        .collect();
    let [least, bound] = LOST_SHARE.map(|share| (share * edges.len() as f64) as usize);
    if least == bound {
        return; // The published code then draws below 1.
    }
    for _ in 0..random.random_range(least..bound) {
        image.values_mut()[edges[random.random_range(0..edges.len())]] = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use crate::random::{Purpose, stream};

    use super::*;

    const DRAWS: u64 = 4000;

    /// An image with steps between columns, so that the gradient has many values and its quantile is well defined.
    fn stairs() -> Raster<f32> {
        let values = (0..100 * 100).map(|i| ((i % 100) * (i % 97) % 89 + 1) as f32 / 90.0);
        Raster::new(100, 100, values.collect()).unwrap()
    }

    #[test]
    fn lost_pixels_lie_at_edges_and_are_as_many_as_published() {
        let image = stairs();
        let gradient = gradient(&image);
        let threshold = quantile(gradient.values(), 0.998);
        let edges = gradient.values().iter().filter(|&&g| g > threshold).count();
        assert_eq!(edges, 20);
        let lost: Vec<f64> = (0..DRAWS)
            .map(|index| {
                let mut changed = image.clone();
                let random = &mut stream(2, Purpose::Augmentation, index);
                lose_edge_pixels(&mut changed, random);
                let places = (0..10_000).filter(|&i| changed.values()[i] != image.values()[i]);
                let places: Vec<usize> = places.collect();
                for &i in &places {
                    assert!(changed.values()[i] == 0.0 && gradient.values()[i] > threshold);
                }
                places.len() as f64
            })
            .collect();
        // n uniform on 2..=9 draws of N = 20 with replacement: the expected number of distinct pixels is N (1 − (1 − 1/N)ⁿ).
        let n = edges as f64;
        let different = |draws: i32| n * (1.0 - (1.0 - 1.0 / n).powi(draws));
        let mean = (2..10).map(different).sum::<f64>() / 8.0;
        let square = lost.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
        let draws = DRAWS as f64;
        let z = (lost.iter().sum::<f64>() / draws - mean) / (square / draws / draws).sqrt();
        assert!(z.abs() < 4.0, "{z:.1} standard errors"); // 6e-5
        assert_eq!(lost.iter().copied().fold(0.0, f64::max), 9.0);
    }

    #[test]
    fn few_edge_pixels_are_kept() {
        let mut flat = Raster::new(36, 36, vec![0.5; 1296]).unwrap();
        let before = flat.clone();
        lose_edge_pixels(&mut flat, &mut stream(1, Purpose::Augmentation, 0));
        assert_eq!(flat, before);
    }
}
