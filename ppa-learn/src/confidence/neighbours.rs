//! How far descriptions of images lie from those of training images.

use super::intervals::conformal_quantile;

/// The neighbour whose distance counts: a single odd training image then makes no other one familiar.
const NEIGHBOUR: usize = 5;

/// Vectors that describe training images, and how far from them those of other images of the kind lie: at the Euclidean distance to the
/// fifth nearest.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Neighbours {
    /// Vectors of training images, one after the other.
    pub references: Vec<f32>,
    /// Values of each.
    pub size: usize,
    /// Distance that the stated share of calibration images does not exceed.
    pub limit: f32,
}

impl Neighbours {
    /// From vectors of training images and of images that the network was not trained with, of which a share of `coverage` shall not
    /// exceed the limit.
    ///
    /// None for too few images: fewer of training than the neighbour's number, or than coverage / (1 − coverage) others.
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

    /// Whether there are so many that one has the distance.
    pub fn are_enough(&self) -> bool {
        self.size > 0 && self.references.len() >= NEIGHBOUR * self.size
    }

    /// Distance of a vector as a share of the limit.
    ///
    /// # Panics
    /// If it has another length than those of training images.
    pub fn relative_distance(&self, own: &[f32]) -> f32 {
        self.distance(own) / self.limit
    }

    /// Distance to the nearest but some.
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
