//! Sampling for training: either balanced over the labels or with equal probability for all samples.

use rand::RngExt;

use crate::random::{Purpose, stream};

use super::error::DataError;
use super::sample::Sample;

/// Number of buckets of equal width between labels 1 and 3; the last one includes label 3.
pub const BUCKETS: usize = 9;

/// Returns the bucket of a label; `None` for labels outside 1 to 3.
pub fn bucket(label: f64) -> Option<usize> {
    let edge = |i: usize| 1.0 + i as f64 * (2.0 / BUCKETS as f64);
    (1.0..=3.0)
        .contains(&label)
        .then(|| (1..BUCKETS).filter(|&i| edge(i) <= label).count())
}

/// Samples by bucket: draws a nonempty bucket, then one of its samples, both uniformly and with replacement. Unbalanced samples are in
/// a single bucket.
#[derive(Debug, Clone)]
pub struct Balanced {
    buckets: Vec<Vec<usize>>,
}

impl Balanced {
    /// Sorts samples into buckets.
    ///
    /// # Errors
    /// [`DataError`] for no samples, or a label outside 1 to 3.
    pub fn new(samples: &[Sample]) -> Result<Self, DataError> {
        let mut buckets = vec![Vec::new(); BUCKETS];
        for (place, sample) in samples.iter().enumerate() {
            let bucket = bucket(sample.label).ok_or_else(|| DataError::Label {
                sample: sample.id.clone(),
                label: sample.label,
            })?;
            buckets[bucket].push(place);
        }
        buckets.retain(|bucket| !bucket.is_empty());
        if buckets.is_empty() {
            return Err(DataError::Empty("to train on".into()));
        }
        Ok(Self { buckets })
    }

    /// Removes the balance: all samples are drawn with equal probability.
    #[must_use]
    pub fn unbalanced(self) -> Self {
        let mut all = self.buckets.concat();
        all.sort_unstable();
        Self { buckets: vec![all] }
    }

    /// Returns the number of the sample at `index` in the endless sequence of `seed`.
    pub fn pick(&self, seed: u64, index: u64) -> usize {
        let mut random = stream(seed, Purpose::Sampling, index);
        let bucket = &self.buckets[random.random_range(0..self.buckets.len())];
        bucket[random.random_range(0..bucket.len())]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::sample::tests::sample;

    #[test]
    fn buckets_by_hand() {
        let labels = [1.0, 1.125, 1.25, 1.5, 2.0, 2.5, 2.75, 2.875, 3.0];
        let found = labels.map(|label| bucket(label).unwrap());
        assert_eq!(found, [0, 0, 1, 2, 4, 6, 7, 8, 8]);
        for outside in [0.999, 3.001, f64::NAN] {
            assert_eq!(bucket(outside), None);
        }
    }

    #[test]
    fn buckets_are_drawn_evenly_and_so_are_their_samples() {
        // 90 of label 1, 9 of 2, 1 of 3: a third of the draws each.
        let label = |i| match i {
            0..90 => 1.0,
            90..99 => 2.0,
            _ => 3.0,
        };
        let samples: Vec<Sample> = (0..100).map(|i| sample(label(i), i as u32)).collect();
        let balanced = Balanced::new(&samples).unwrap();
        let draws = 30_000;
        let mut counts = [0.0; 100];
        for index in 0..draws {
            counts[balanced.pick(5, index)] += 1.0;
        }
        let chi2: f64 = (0..100)
            .map(|i| {
                let share = [90.0, 9.0, 1.0][bucket(label(i)).unwrap() / 4];
                let expected = draws as f64 / 3.0 / share;
                (counts[i] - expected).powi(2) / expected
            })
            .sum();
        assert!(chi2 < 161.4, "chi squared {chi2:.1}"); // 99 degrees of freedom: 7e-5
    }

    #[test]
    fn samples_are_drawn_alike_without_balance() {
        let labels = [1.0, 1.0, 1.0, 3.0];
        let samples: Vec<Sample> = (0..4).map(|i| sample(labels[i], i as u32)).collect();
        let all = Balanced::new(&samples).unwrap().unbalanced();
        let mut counts = [0; 4];
        for index in 0..4000 {
            counts[all.pick(5, index)] += 1;
        }
        // Five standard deviations of 27.4.
        let near = |count: &i32| (count - 1000).abs() < 137;
        assert!(counts.iter().all(near), "{counts:?}");
    }

    #[test]
    fn labels_outside_the_scale_are_named() {
        let error = Balanced::new(&[sample(1.0, 0), sample(3.5, 1)]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "sample 1 has the label 3.5, expected 1 to 3"
        );
        assert!(matches!(Balanced::new(&[]), Err(DataError::Empty(_))));
    }
}
