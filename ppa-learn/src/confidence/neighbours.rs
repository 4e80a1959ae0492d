//! Distance of an image's descriptor from the descriptors of training images.

use super::intervals::conformal_quantile;

/// The k of the k-th nearest neighbour: with k above 1, one outlier among the training images does not let similar images pass.
const NEIGHBOUR: usize = 5;

/// One descriptor of every training image, and a limit on the Euclidean distance to the fifth nearest of them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Neighbours {
    /// Descriptors of training images, one after the other.
    pub references: Vec<f32>,
    /// Number of values of each descriptor.
    pub size: usize,
    /// Distance that the stated share of calibration images does not exceed.
    pub limit: f32,
}

impl Neighbours {
    /// Sets the limit to the distance that a share of `coverage` of the calibration images (`others`) does not exceed.
    ///
    /// `None` for too few images: fewer than five training images, or than coverage / (1 − coverage) calibration images.
    pub fn new(training: &[&[f32]], others: &[&[f32]], coverage: f64) -> Option<Self> {
        let mut neighbours = Self {
            references: training.concat(),
            size: training.first()?.len(),
            limit: f32::INFINITY,
        };
        if !neighbours.are_enough() {
            return None;
        }
        let distances = others.iter().map(|other| neighbours.distance(other));
        neighbours.limit = conformal_quantile(distances.map(f64::from), coverage)? as f32;
        Some(neighbours)
    }

    /// Returns whether there are enough references for the distance to the fifth neighbour.
    pub fn are_enough(&self) -> bool {
        self.size > 0 && self.references.len() >= NEIGHBOUR * self.size
    }

    /// Returns the distance of a descriptor as a share of the limit.
    ///
    /// # Panics
    /// If its length differs from that of the training descriptors.
    pub fn relative_distance(&self, own: &[f32]) -> f32 {
        self.distance(own) / self.limit
    }

    /// Distance to the k-th nearest reference.
    fn distance(&self, own: &[f32]) -> f32 {
        assert_eq!(own.len(), self.size, "vectors of the same kind");
        let of_one = |one: &[f32]| {
            one.iter()
                .zip(own)
                .map(|(a, b)| (a - b).powi(2))
                .sum::<f32>()
        };
        let references = self.references.chunks_exact(self.size);
        let mut squares: Vec<f32> = references.map(of_one).collect();
        let (_, nearest, _) = squares.select_nth_unstable_by(NEIGHBOUR - 1, f32::total_cmp);
        nearest.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 0 to 9, and 99 values from 0 to 9.8, whose last is 4.8 from its fifth neighbour.
    #[test]
    fn distance_is_to_the_fifth_neighbour() {
        let training: Vec<_> = (0..10).map(|n| [n as f32]).collect();
        let training: Vec<&[f32]> = training.iter().map(|one| &one[..]).collect();
        let others: Vec<_> = (0..99).map(|n| [0.1 * n as f32]).collect();
        let others: Vec<&[f32]> = others.iter().map(|one| &one[..]).collect();
        let neighbours = Neighbours::new(&training, &others, 0.99).unwrap();
        assert!(
            (neighbours.limit - 4.8).abs() < 1e-5,
            "{}",
            neighbours.limit
        );
        assert!((neighbours.relative_distance(&[-2.0]) - 6.0 / 4.8).abs() < 1e-5);
        assert_eq!(Neighbours::new(&training, &others[..98], 0.99), None);
        assert_eq!(Neighbours::new(&training[..4], &others, 0.99), None);
    }
}
