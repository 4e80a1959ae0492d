//! All metrics of one set of predictions.

use serde::Serialize;

use crate::diagnostic::{diagnostic_accuracy, sensitivity, specificity};
use crate::error::MetricError;
use crate::regression::{accuracy, mae, mse};
use crate::spearman::spearman;

/// The metrics of labelled predictions; serialises to the keys of `ppa metrics --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Number of samples.
    pub n: usize,
    /// Mean squared error.
    pub mse: f64,
    /// Mean absolute error.
    pub mae: f64,
    /// Spearman's rank correlation.
    pub spearman: f64,
    /// Share with |error| < 0.5.
    pub accuracy: f64,
    /// Share on the label's side of 2.5.
    pub diagnostic_accuracy: f64,
    /// Share of the non-diagnostic labels that are found.
    pub sensitivity: f64,
    /// Share of the diagnostic labels that are found.
    pub specificity: f64,
}

/// All metrics of predictions against their labels.
///
/// # Errors
/// [`MetricError`] if any of the metrics is not defined: empty, unequal or non-finite input, constant labels or
/// predictions, no diagnostic or no non-diagnostic label. The metrics that are defined can still be had one by one.
pub fn evaluate(labels: &[f64], predictions: &[f64]) -> Result<Report, MetricError> {
    Ok(Report {
        n: labels.len(),
        mse: mse(labels, predictions)?,
        mae: mae(labels, predictions)?,
        spearman: spearman(labels, predictions)?,
        accuracy: accuracy(labels, predictions)?,
        diagnostic_accuracy: diagnostic_accuracy(labels, predictions)?,
        sensitivity: sensitivity(labels, predictions)?,
        specificity: specificity(labels, predictions)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_defined_makes_no_report() {
        assert!(matches!(
            evaluate(&[1.0, 3.0], &[2.0, 2.0]),
            Err(MetricError::Constant { .. })
        ));
        assert_eq!(
            evaluate(&[1.0, 2.0], &[1.0, 2.0]),
            Err(MetricError::NoPositives)
        );
        assert_eq!(
            evaluate(&[3.0, 2.5], &[1.0, 2.0]),
            Err(MetricError::NoNegatives)
        );
        assert_eq!(evaluate(&[], &[]), Err(MetricError::Empty("labels")));
        let report = evaluate(&[1.0, 3.0], &[1.25, 2.75]).unwrap();
        assert_eq!(
            (report.n, report.mae, report.mse, report.spearman),
            (2, 0.25, 0.0625, 1.0)
        );
    }
}
