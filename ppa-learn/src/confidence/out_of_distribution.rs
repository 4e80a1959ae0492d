//! Detection of images outside the distribution of the training images.

use super::neighbours::Neighbours;
use crate::network::FEATURES;

/// Number of blocks in each direction of an image; their mean values describe it.
const BLOCKS: usize = 8;

/// Descriptors of one image for [`OutOfDistributionDetector`].
#[derive(Debug, Clone, PartialEq)]
pub struct Descriptors {
    /// The network's features, normalised to length 1.
    pub(crate) features: Vec<f32>,
    /// Mean values of blocks of the network's input.
    pub(crate) blocks: Vec<f32>,
}

impl Descriptors {
    /// Returns the number of features and of blocks for images of `side` x `side` pixels.
    pub(crate) fn sizes(side: usize) -> [usize; 2] {
        [FEATURES, BLOCKS.min(side).pow(2)]
    }

    /// Computes the descriptors from the network's features and its square input of `side` x `side` values.
    ///
    /// # Panics
    /// If the input does not have `side` x `side` values.
    pub fn new(features: &[f32], input: &[f32], side: usize) -> Self {
        assert_eq!(input.len(), side * side, "a square input");
        let length = features.iter().map(|x| x * x).sum::<f32>().sqrt();
        let share = if length > 0.0 { 1.0 / length } else { 0.0 };
        Self {
            features: features.iter().map(|x| share * x).collect(),
            blocks: blocks(input, side),
        }
    }
}

/// Detector of images of one camera that are unlike the training images, by the distances of two descriptors:
///
/// * the network's features at length 1 (Sun et al., ICML 2022, "Out-of-distribution detection with deep nearest neighbors");
/// * the mean depths of 8 x 8 blocks, because a network trained only on limbs may give a plain wall the features of a limb.
#[derive(Debug, Clone, PartialEq)]
pub struct OutOfDistributionDetector {
    pub(crate) features: Neighbours,
    pub(crate) blocks: Neighbours,
}

impl OutOfDistributionDetector {
    /// Builds a detector from training images and from calibration images that the network was not trained with. Each descriptor's limit is
    /// the distance that a share of `coverage` of the calibration images does not exceed.
    ///
    /// `None` for too few images: fewer than five training images, or than coverage / (1 − coverage) calibration images.
    ///
    /// # Panics
    /// If the descriptors are of different networks.
    pub fn new(
        training: &[Descriptors],
        calibration: &[Descriptors],
        coverage: f64,
    ) -> Option<Self> {
        let neighbours = |descriptor: fn(&Descriptors) -> &[f32]| {
            let [training, calibration] =
                [training, calibration].map(|all| all.iter().map(descriptor).collect::<Vec<_>>());
            Neighbours::new(&training, &calibration, coverage)
        };
        Some(Self {
            features: neighbours(|image| &image.features)?,
            blocks: neighbours(|image| &image.blocks)?,
        })
    }

    /// Returns the distance of an image from the training images as a share of the limit, the larger one of the two descriptors. An image
    /// above 1 is out of distribution.
    ///
    /// # Panics
    /// If the descriptors are of another network.
    pub fn relative_distance(&self, image: &Descriptors) -> f32 {
        let of_features = self.features.relative_distance(&image.features);
        of_features.max(self.blocks.relative_distance(&image.blocks))
    }
}

/// Mean values of blocks, row by row.
fn blocks(input: &[f32], side: usize) -> Vec<f32> {
    let count = BLOCKS.min(side);
    let part = |n: usize| n * side / count..(n + 1) * side / count;
    let mean = |row: usize, column: usize| {
        let pixels = part(row).flat_map(|y| &input[y * side..][part(column)]);
        let area = part(row).len() * part(column).len();
        pixels.sum::<f32>() / area as f32
    };
    let all = |row| (0..count).map(move |column| mean(row, column));
    (0..count).flat_map(all).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Features that point in a direction of a plane, and an image of uniform depth.
    fn image(degrees: f32, depth: f32) -> Descriptors {
        let (sin, cos) = degrees.to_radians().sin_cos();
        Descriptors::new(&[3.0 * cos, 3.0 * sin], &[depth; 100], 10)
    }

    #[test]
    fn odd_features_and_odd_depths_are_out_of_distribution() {
        let training: Vec<_> = (0..10).map(|n| image(n as f32, 0.01 * n as f32)).collect();
        let other = |n| image(0.1 * n as f32, 0.001 * n as f32);
        let others: Vec<_> = (0..99).map(other).collect();
        let detector = OutOfDistributionDetector::new(&training, &others, 0.99).unwrap();
        let distance = |degrees, depth| detector.relative_distance(&image(degrees, depth));
        assert!(distance(5.0, 0.05) < 1.0);
        assert!(distance(15.0, 0.05) > 1.0);
        assert!(distance(5.0, 0.15) > 1.0);
        let zeros = Descriptors::new(&[0.0, 0.0], &[0.05; 100], 10);
        assert!(detector.relative_distance(&zeros) > 1.0);
    }

    #[test]
    fn blocks_of_an_uneven_side_are_means_of_their_pixels() {
        let input: Vec<f32> = (0..100).map(|n| (n % 10) as f32).collect();
        let columns = [0.0, 1.0, 2.0, 3.5, 5.0, 6.0, 7.0, 8.5];
        assert_eq!(blocks(&input, 10)[..8], columns);
        assert_eq!(blocks(&input, 10).len(), 64);
        assert_eq!(blocks(&[1.0, 2.0, 3.0, 4.0], 2), [1.0, 2.0, 3.0, 4.0]);
    }
}
