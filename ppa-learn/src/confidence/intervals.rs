//! Prediction intervals by split conformal prediction.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Minimum number of calibration poses per bin.
const MIN_POSES_PER_BIN: usize = 50;
/// Maximum number of bins: more would fit noise.
const MAX_BINS: usize = 5;
/// Relative tolerance for floating-point errors when rounding up: 0.9 (9 + 1) is 9, not slightly more.
const ROUNDING: f64 = 1e-12;
/// Range of the quality.
const QUALITY: [f64; 2] = [1.0, 3.0];

/// Error of a calibration of intervals.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ConfidenceError {
    /// A coverage outside of 0 to 1.
    #[error("coverage is {0}, expected more than 0 and less than 1")]
    Coverage(f64),
    /// Too few poses for an interval of finite width.
    #[error(
        "{found} calibration poses, expected at least {expected} for intervals of coverage {coverage}"
    )]
    TooFew {
        /// Number of calibration poses.
        found: usize,
        /// Minimum number of poses.
        expected: usize,
        /// Coverage of the intervals.
        coverage: f64,
    },
    /// A label or a prediction that is not finite.
    #[error("a label or prediction of a calibration pose is not finite")]
    NotFinite,
}

/// Half widths of prediction intervals, by prediction.
///
/// Split conformal prediction (Lei et al. 2018): the half width is the ⌈(n + 1) coverage⌉-th smallest absolute error of n poses that the
/// network was not trained with. The interval then contains the label of a new pose with a probability of at least the coverage,
/// provided that the poses are exchangeable. Poses of one person are alike, so for few persons this holds only approximately;
/// [`coverage_of_left_out`] shows how well. Each bin of predictions has its own half width (Mondrian conformal
/// prediction, Vovk et al. 2003), because errors in the middle of the scale are larger than at its ends.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Intervals {
    /// Probability that an interval contains the label.
    pub coverage: f64,
    /// Bins in the order of their predictions.
    pub bins: Vec<IntervalBin>,
}

/// Range of predictions that share one half width.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct IntervalBin {
    /// Greatest prediction of the bin; the last bin holds all greater ones as well.
    pub to: f64,
    /// Half width of the interval.
    pub half_width: f64,
    /// Number of calibration poses.
    pub poses: usize,
}

impl Intervals {
    /// Computes intervals of the given coverage from (label, prediction) of poses that the network was not trained with.
    ///
    /// # Errors
    /// [`ConfidenceError`].
    pub fn new(poses: &[(f64, f64)], coverage: f64) -> Result<Self, ConfidenceError> {
        if !(coverage > 0.0 && coverage < 1.0) {
            return Err(ConfidenceError::Coverage(coverage));
        }
        if !poses.iter().all(|(x, y)| x.is_finite() && y.is_finite()) {
            return Err(ConfidenceError::NotFinite);
        }
        let least = (coverage / (1.0 - coverage) * (1.0 - ROUNDING)).ceil() as usize;
        let mut sorted = poses.to_vec();
        sorted.sort_by(|a, b| a.1.total_cmp(&b.1));
        let count = sorted.len();
        let number = (count / MIN_POSES_PER_BIN.max(least)).clamp(1, MAX_BINS);
        let bin = |n: usize| {
            let poses = &sorted[n * count / number..(n + 1) * count / number];
            let errors = poses
                .iter()
                .map(|(label, prediction)| (label - prediction).abs());
            Some(IntervalBin {
                to: poses.last()?.1,
                half_width: conformal_quantile(errors, coverage)?,
                poses: poses.len(),
            })
        };
        match (0..number).map(bin).collect() {
            Some(bins) => Ok(Self { coverage, bins }),
            None => Err(ConfidenceError::TooFew {
                found: count,
                expected: least,
                coverage,
            }),
        }
    }

    /// Returns the lower and upper limits of the label for a prediction, clamped to 1 to 3.
    pub fn interval(&self, prediction: f64) -> [f64; 2] {
        let place = self.bins.partition_point(|bin| bin.to < prediction);
        let bin = self.bins[place.min(self.bins.len() - 1)];
        let [min, max] = QUALITY;
        [-bin.half_width, bin.half_width].map(|offset| (prediction + offset).clamp(min, max))
    }
}

/// Returns the ⌈(n + 1) coverage⌉-th smallest of n values; `None` if there are too few.
pub(super) fn conformal_quantile(values: impl Iterator<Item = f64>, coverage: f64) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let rank = ((values.len() + 1) as f64 * coverage * (1.0 - ROUNDING)).ceil() as usize;
    values.get(rank.checked_sub(1)?).copied()
}

/// Returns the share of poses (person, label, prediction) whose label is in the interval calibrated on all other persons: an estimate of
/// the coverage for a new person. `None` for a single person, or if the others have too few poses.
pub fn coverage_of_left_out<P: Ord + Copy>(poses: &[(P, f64, f64)], coverage: f64) -> Option<f64> {
    let mut persons: BTreeMap<P, Vec<(f64, f64)>> = BTreeMap::new();
    for &(person, label, prediction) in poses {
        persons.entry(person).or_default().push((label, prediction));
    }
    let mut inside = 0;
    for (person, own) in &persons {
        let others = poses.iter().filter(|pose| pose.0 != *person);
        let others: Vec<_> = others
            .map(|&(_, label, prediction)| (label, prediction))
            .collect();
        let intervals = Intervals::new(&others, coverage).ok()?;
        let hit = |&&(label, prediction): &&(f64, f64)| {
            let [low, high] = intervals.interval(prediction);
            (low..=high).contains(&label)
        };
        inside += own.iter().filter(hit).count();
    }
    (!poses.is_empty()).then(|| inside as f64 / poses.len() as f64)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use super::*;

    #[test]
    fn nine_poses_give_an_interval_of_their_greatest_error() {
        let poses: Vec<_> = (1..=9).map(|n| (2.0, 2.0 + 0.1 * f64::from(n))).collect();
        let intervals = Intervals::new(&poses, 0.9).unwrap();
        assert_eq!(intervals.bins.len(), 1);
        let [low, high] = intervals.interval(1.95);
        assert!((low - 1.05).abs() < 1e-12 && (high - 2.85).abs() < 1e-12);
        assert_eq!(intervals.interval(2.9)[1], 3.0);
        let few = Intervals::new(&poses[1..], 0.9).unwrap_err();
        assert!(
            few.to_string()
                .starts_with("8 calibration poses, expected at least 9"),
            "{few}"
        );
    }

    /// 200 persons of 30 poses whose errors are exchangeable: the share of covered labels of 90 % has a standard error of
    /// sqrt(0.9 * 0.1 / 6000) = 0.004; 0.02 is five of them.
    #[test]
    fn intervals_of_wider_errors_are_wider_and_cover() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let poses: Vec<_> = (0..6000)
            .map(|n| {
                let label: f64 = 1.0 + 2.0 * random.random::<f64>();
                // Wide in the middle of the scale.
                let width = 0.1 + 0.5 * (1.0 - (label - 2.0).abs());
                let prediction = label + width * (random.random::<f64>() - 0.5);
                (n / 30, label, prediction)
            })
            .collect();
        let pairs: Vec<_> = poses.iter().map(|&(_, x, y)| (x, y)).collect();
        let intervals = Intervals::new(&pairs, 0.9).unwrap();
        let width = |at| intervals.interval(at)[1] - intervals.interval(at)[0];
        assert_eq!(intervals.bins.len(), MAX_BINS);
        assert!(width(2.0) > 1.5 * width(1.3), "{intervals:?}");
        let covered = coverage_of_left_out(&poses, 0.9).unwrap();
        assert!((covered - 0.9).abs() < 0.02, "{covered}");
    }
}
