//! Errors of predictions: mean squared and mean absolute error.

use crate::error::{MetricError, check_scores};

/// Step of the annotation scale; an error below it counts as accurate.
pub const ANNOTATION_STEP: f64 = 0.5;

/// Mean of `score` over pairs of label and prediction.
pub(crate) fn mean_score(
    labels: &[f64],
    predictions: &[f64],
    score: impl Fn(f64, f64) -> f64,
) -> Result<f64, MetricError> {
    check_scores(labels, predictions)?;
    let sum: f64 = labels
        .iter()
        .zip(predictions)
        .map(|(&x, &y)| score(x, y))
        .sum();
    Ok(sum / labels.len() as f64)
}

/// Mean squared error: (1/N) Σ (y − x)².
///
/// # Errors
/// [`MetricError`] for empty, unequal or non-finite input.
pub fn mse(labels: &[f64], predictions: &[f64]) -> Result<f64, MetricError> {
    mean_score(labels, predictions, |x, y| (y - x).powi(2))
}

/// Mean absolute error: (1/N) Σ |y − x|.
///
/// # Errors
/// [`MetricError`] for empty, unequal or non-finite input.
pub fn mae(labels: &[f64], predictions: &[f64]) -> Result<f64, MetricError> {
    mean_score(labels, predictions, |x, y| (y - x).abs())
}

/// Accuracy: share of predictions with |y − x| < 0.5, less than one annotation step.
///
/// # Errors
/// [`MetricError`] for empty, unequal or non-finite input.
pub fn accuracy(labels: &[f64], predictions: &[f64]) -> Result<f64, MetricError> {
    mean_score(labels, predictions, |x, y| {
        f64::from((y - x).abs() < ANNOTATION_STEP)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_by_hand() {
        let (labels, predictions) = ([1.0, 2.0, 3.0, 1.5], [1.5, 2.25, 2.0, 1.5]);
        assert_eq!(mse(&labels, &predictions), Ok((0.25 + 0.0625 + 1.0) / 4.0));
        assert_eq!(mae(&labels, &predictions), Ok((0.5 + 0.25 + 1.0) / 4.0));
        assert_eq!(
            accuracy(&labels, &predictions),
            Ok(0.5),
            "an error of exactly 0.5 is not accurate"
        );
    }

    #[test]
    fn what_has_no_value_is_an_error() {
        assert_eq!(mae(&[], &[]), Err(MetricError::Empty("labels")));
        assert!(matches!(
            mae(&[1.0], &[1.0, 2.0]),
            Err(MetricError::Length { .. })
        ));
        assert!(matches!(
            mse(&[1.0, f64::NAN], &[1.0, 2.0]),
            Err(MetricError::NotFinite { index: 1, .. })
        ));
        let infinite = accuracy(&[1.0], &[f64::INFINITY]);
        assert!(matches!(
            infinite,
            Err(MetricError::NotFinite {
                what: "predictions",
                index: 0,
                ..
            })
        ));
    }
}
