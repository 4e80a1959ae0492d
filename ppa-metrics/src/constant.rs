//! Predictions that are nearly constant.

use std::fmt;

use serde::Serialize;

use crate::error::{MetricError, check_scores};

/// Predictions count as constant if their standard deviation is below this share of the range of the labels.
pub const LEAST_SPREAD: f64 = 0.01;

/// Predictions that are all the same, or nearly so, with the metrics of a constant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ConstantPrediction {
    /// Number of predictions.
    pub n: usize,
    /// Their mean.
    pub mean: f64,
    /// Their standard deviation, dividing by n.
    pub std: f64,
    /// Largest label minus smallest label.
    pub label_range: f64,
}

/// Tests whether predictions are constant: their standard deviation is 0, or below [`LEAST_SPREAD`] of the range of the labels.
///
/// `None` if they are not, or if all labels are equal, since a constant is then as good as any answer.
///
/// # Errors
/// [`MetricError`] for empty, unequal or non-finite input.
pub fn constant_prediction(
    labels: &[f64],
    predictions: &[f64],
) -> Result<Option<ConstantPrediction>, MetricError> {
    check_scores(labels, predictions)?;
    let n = predictions.len();
    let mean = predictions.iter().sum::<f64>() / n as f64;
    let squares = predictions.iter().map(|value| (value - mean).powi(2));
    let std = (squares.sum::<f64>() / n as f64).sqrt();
    let most = labels.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let least = labels.iter().copied().fold(f64::INFINITY, f64::min);
    let label_range = most - least;
    Ok(
        (std < LEAST_SPREAD * label_range).then_some(ConstantPrediction {
            n,
            mean,
            std,
            label_range,
        }),
    )
}

impl fmt::Display for ConstantPrediction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            n,
            mean,
            std,
            label_range,
        } = self;
        write!(
            f,
            "The network predicts a constant: {mean:.3} with a standard deviation of {std:.4} over {n} predictions, less than \
             {} % of the labels' range of {label_range}; the metrics are those of a constant.",
            100.0 * LEAST_SPREAD
        )
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn predictions_without_spread_are_constant() {
        let labels = [1.0, 1.5, 2.0, 3.0];
        let found = constant_prediction(&labels, &[1.75; 4]).unwrap().unwrap();
        assert_eq!((found.mean, found.std, found.label_range), (1.75, 0.0, 2.0));
        assert!(found.to_string().contains("1.750"), "{found}");
        // 2 ± 0.019 and 2 ± 0.021: below and above 1 % of 2.
        let spread = |half: f64| [2.0 - half, 2.0 + half, 2.0 - half, 2.0 + half];
        assert!(
            constant_prediction(&labels, &spread(0.019))
                .unwrap()
                .is_some()
        );
        assert!(
            constant_prediction(&labels, &spread(0.021))
                .unwrap()
                .is_none()
        );
    }

    #[test]
    fn equal_labels_say_nothing_of_the_predictions() {
        assert_eq!(constant_prediction(&[2.0, 2.0], &[1.9, 1.9]), Ok(None));
        assert_eq!(constant_prediction(&[2.0], &[1.9]), Ok(None));
        let wrong = constant_prediction(&[1.0, 3.0], &[2.0, f64::NAN]);
        assert!(matches!(wrong, Err(MetricError::NotFinite { .. })));
    }

    proptest! {
        /// A common offset and scale change nothing.
        #[test]
        fn units_do_not_matter(spread in 0.0..0.04_f64, shift in -5.0..5.0_f64, scale in 0.1..10.0_f64) {
            prop_assume!((spread - 0.02).abs() > 1e-6);
            let map = |values: [f64; 4]| values.map(|value| scale * value + shift);
            let labels = map([1.0, 3.0, 1.0, 3.0]);
            let predictions = map([2.0 - spread, 2.0 + spread, 2.0 + spread, 2.0 - spread]);
            let found = constant_prediction(&labels, &predictions).unwrap();
            prop_assert_eq!(found.is_some(), spread < 0.02);
        }
    }
}
