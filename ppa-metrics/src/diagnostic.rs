//! Binary decision of a prediction: diagnostic, or to be retaken.

use crate::error::{MetricError, check_scores};
use crate::regression::mean_score;

/// Quality at and above which a pose is non-diagnostic.
pub const NON_DIAGNOSTIC: f64 = 2.5;

/// Diagnostic accuracy: share of pairs on the same side of 2.5 (2.5 itself is non-diagnostic).
///
/// # Errors
/// [`MetricError`] for empty, unequal or non-finite input.
pub fn diagnostic_accuracy(labels: &[f64], predictions: &[f64]) -> Result<f64, MetricError> {
    mean_score(labels, predictions, |x, y| {
        f64::from((y < NON_DIAGNOSTIC) == (x < NON_DIAGNOSTIC))
    })
}

/// Sensitivity: share of the non-diagnostic labels (≥ 2.5) whose prediction is non-diagnostic as well.
///
/// # Errors
/// [`MetricError::NoPositives`] if there is no such label; empty, unequal or non-finite input.
pub fn sensitivity(labels: &[f64], predictions: &[f64]) -> Result<f64, MetricError> {
    recall(labels, predictions, |quality| quality >= NON_DIAGNOSTIC)?
        .ok_or(MetricError::NoPositives)
}

/// Specificity: share of the diagnostic labels (< 2.5) whose prediction is diagnostic as well.
///
/// # Errors
/// [`MetricError::NoNegatives`] if there is no such label; empty, unequal or non-finite input.
pub fn specificity(labels: &[f64], predictions: &[f64]) -> Result<f64, MetricError> {
    recall(labels, predictions, |quality| quality < NON_DIAGNOSTIC)?.ok_or(MetricError::NoNegatives)
}

/// Share of the labels in a class whose prediction is also in it; `None` if no label is.
fn recall(
    labels: &[f64],
    predictions: &[f64],
    in_class: impl Fn(f64) -> bool,
) -> Result<Option<f64>, MetricError> {
    check_scores(labels, predictions)?;
    let (mut members, mut found) = (0_u64, 0_u64);
    for (_, &prediction) in labels
        .iter()
        .zip(predictions)
        .filter(|(label, _)| in_class(**label))
    {
        members += 1;
        found += u64::from(in_class(prediction));
    }
    Ok((members > 0).then(|| found as f64 / members as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    // Positives: 2.5, 3.0, 3.0 (two found); negatives: 1.0, 2.0 (one found).
    const LABELS: [f64; 5] = [2.5, 3.0, 3.0, 1.0, 2.0];
    const PREDICTIONS: [f64; 5] = [2.5, 2.7, 2.49, 1.2, 2.6];

    #[test]
    fn positive_means_non_diagnostic_and_includes_the_threshold() {
        assert_eq!(diagnostic_accuracy(&LABELS, &PREDICTIONS), Ok(3.0 / 5.0));
        assert_eq!(sensitivity(&LABELS, &PREDICTIONS), Ok(2.0 / 3.0));
        assert_eq!(specificity(&LABELS, &PREDICTIONS), Ok(1.0 / 2.0));
    }

    #[test]
    fn a_class_without_members_has_no_share() {
        assert_eq!(
            sensitivity(&[1.0, 2.0], &[3.0, 1.0]),
            Err(MetricError::NoPositives)
        );
        assert_eq!(
            specificity(&[2.5, 3.0], &[3.0, 1.0]),
            Err(MetricError::NoNegatives)
        );
        assert!(matches!(
            sensitivity(&[3.0], &[f64::NAN]),
            Err(MetricError::NotFinite { .. })
        ));
    }
}
