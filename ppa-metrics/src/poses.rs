//! Averages over views and frames, and the ranking of one good against two bad poses of the same foot.

use serde::{Deserialize, Serialize};

use crate::error::{MetricError, check_pair, check_values};
use crate::regression::ANNOTATION_STEP;

/// Frame-averaged predictions for one subject-foot pair: one well positioned pose and two badly positioned ones.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PoseTriple {
    /// Prediction for the good pose.
    pub good: f64,
    /// Predictions for the bad poses.
    pub bad: [f64; 2],
}

/// Prediction per pose, (y₁ + y₂)/2, from the predictions of the networks of the two camera views.
///
/// # Errors
/// [`MetricError`] for empty, unequal or non-finite input.
pub fn mean_of_views(first: &[f64], second: &[f64]) -> Result<Vec<f64>, MetricError> {
    check_pair(
        ("predictions of view 1", first),
        ("predictions of view 2", second),
    )?;
    Ok(first
        .iter()
        .zip(second)
        .map(|(a, b)| 0.5 * (a + b))
        .collect())
}

/// Prediction per pose, the mean over its frames; poses may have different numbers of frames.
///
/// # Errors
/// [`MetricError`] for no pose, a pose without frames, or a prediction that is not finite.
pub fn mean_per_pose<F: AsRef<[f64]>>(poses: &[F]) -> Result<Vec<f64>, MetricError> {
    if poses.is_empty() {
        return Err(MetricError::Empty("poses"));
    }
    let mean = |frames: &[f64]| {
        check_values("frames of a pose", frames)?;
        Ok(frames.iter().sum::<f64>() / frames.len() as f64)
    };
    poses.iter().map(|frames| mean(frames.as_ref())).collect()
}

/// Pose Delta: mean over pairs of (b₁ + b₂)/2 − g. Larger values mean better separation of good and bad poses.
///
/// # Errors
/// [`MetricError`] for empty or non-finite input.
pub fn pose_delta(pairs: &[PoseTriple]) -> Result<f64, MetricError> {
    mean_over_pairs(
        pairs,
        |PoseTriple {
             good,
             bad: [b1, b2],
         }| 0.5 * (b1 + b2) - good,
    )
}

/// Pose Margin Accuracy: share of pairs with min(b₁, b₂) − g ≥ 0.5, so that even the better of the bad poses is rated
/// at least one annotation step worse than the good one.
///
/// # Errors
/// [`MetricError`] for empty or non-finite input.
pub fn pose_margin_accuracy(pairs: &[PoseTriple]) -> Result<f64, MetricError> {
    mean_over_pairs(
        pairs,
        |PoseTriple {
             good,
             bad: [b1, b2],
         }| f64::from(b1.min(b2) - good >= ANNOTATION_STEP),
    )
}

fn mean_over_pairs(
    pairs: &[PoseTriple],
    score: impl Fn(PoseTriple) -> f64,
) -> Result<f64, MetricError> {
    if pairs.is_empty() {
        return Err(MetricError::Empty("subject-foot pairs"));
    }
    for (index, pair) in pairs.iter().enumerate() {
        if let Some(&found) = [pair.good, pair.bad[0], pair.bad[1]]
            .iter()
            .find(|value| !value.is_finite())
        {
            return Err(MetricError::NotFinite {
                what: "subject-foot pair",
                index,
                found,
            });
        }
    }
    Ok(pairs.iter().map(|&pair| score(pair)).sum::<f64>() / pairs.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_by_hand() {
        let pairs = [
            PoseTriple {
                good: 1.0,
                bad: [2.0, 3.0],
            }, // delta 1.5, margin 1
            PoseTriple {
                good: 1.5,
                bad: [2.0, 2.5],
            }, // delta 0.75, margin exactly 0.5
            PoseTriple {
                good: 2.0,
                bad: [3.0, 2.25],
            }, // delta 0.625, margin 0.25
            PoseTriple {
                good: 2.5,
                bad: [1.5, 1.5],
            }, // delta −1
        ];
        assert_eq!(pose_delta(&pairs), Ok((1.5 + 0.75 + 0.625 - 1.0) / 4.0));
        assert_eq!(pose_margin_accuracy(&pairs), Ok(0.5));
        assert_eq!(
            pose_delta(&[]),
            Err(MetricError::Empty("subject-foot pairs"))
        );
        let broken = [PoseTriple {
            good: 1.0,
            bad: [f64::NAN, 2.0],
        }];
        assert!(matches!(
            pose_margin_accuracy(&broken),
            Err(MetricError::NotFinite { .. })
        ));
    }

    #[test]
    fn frames_and_views_are_averaged() {
        assert_eq!(
            mean_per_pose(&[vec![1.0, 2.0, 3.0], vec![2.5]]),
            Ok(vec![2.0, 2.5])
        );
        assert_eq!(
            mean_per_pose(&[vec![1.0], vec![]]),
            Err(MetricError::Empty("frames of a pose"))
        );
        assert_eq!(mean_of_views(&[1.0, 3.0], &[2.0, 2.0]), Ok(vec![1.5, 2.5]));
        assert!(matches!(
            mean_of_views(&[1.0], &[]),
            Err(MetricError::Length { .. })
        ));
    }
}
