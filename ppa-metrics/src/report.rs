//! All metrics of one set of predictions.

use serde::Serialize;

use crate::constant::{ConstantPrediction, constant_prediction};
use crate::diagnostic::{diagnostic_accuracy, sensitivity, specificity};
use crate::error::MetricError;
use crate::regression::{accuracy, mae, mse};
use crate::spearman::spearman;

/// The metrics of labelled predictions; serialises to the keys of `ppa metrics --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Set if the predictions hardly differ: the metrics are then those of a constant.
    pub constant_prediction: Option<ConstantPrediction>,
    /// Number of samples.
    pub n: usize,
    /// Mean squared error.
    pub mse: f64,
    /// Mean absolute error.
    pub mae: f64,
    /// Spearman's rank correlation; `None` if labels or predictions are all equal.
    pub spearman: Option<f64>,
    /// Share with |error| < 0.5.
    pub accuracy: f64,
    /// Share on the label's side of 2.5.
    pub diagnostic_accuracy: f64,
    /// Share of the non-diagnostic labels that are found; `None` if there is none.
    pub sensitivity: Option<f64>,
    /// Share of the diagnostic labels that are found; `None` if there is none.
    pub specificity: Option<f64>,
}

/// Computes all metrics of predictions against their labels; undefined ones are `None`.
///
/// # Errors
/// [`MetricError`] for empty, unequal or non-finite input.
pub fn evaluate(labels: &[f64], predictions: &[f64]) -> Result<Report, MetricError> {
    Ok(Report {
        constant_prediction: constant_prediction(labels, predictions)?,
        n: labels.len(),
        mse: mse(labels, predictions)?,
        mae: mae(labels, predictions)?,
        spearman: if_defined(spearman(labels, predictions))?,
        accuracy: accuracy(labels, predictions)?,
        diagnostic_accuracy: diagnostic_accuracy(labels, predictions)?,
        sensitivity: if_defined(sensitivity(labels, predictions))?,
        specificity: if_defined(specificity(labels, predictions))?,
    })
}

/// `None` for a metric that is undefined for valid input.
fn if_defined(found: Result<f64, MetricError>) -> Result<Option<f64>, MetricError> {
    match found {
        Ok(value) => Ok(Some(value)),
        Err(MetricError::Constant { .. } | MetricError::NoPositives | MetricError::NoNegatives) => {
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_defined_is_left_open() {
        let constant = evaluate(&[1.0, 3.0], &[2.0, 2.0]).unwrap();
        assert_eq!((constant.mae, constant.spearman), (1.0, None));
        assert_eq!(constant.constant_prediction.unwrap().mean, 2.0);
        let diagnostic = evaluate(&[1.0, 2.0], &[1.0, 2.0]).unwrap();
        assert_eq!(
            (diagnostic.sensitivity, diagnostic.specificity),
            (None, Some(1.0))
        );
        let bad = evaluate(&[3.0, 2.5], &[1.0, 2.0]).unwrap();
        assert_eq!((bad.sensitivity, bad.specificity), (Some(0.0), None));
        assert_eq!(evaluate(&[], &[]), Err(MetricError::Empty("labels")));
        let report = evaluate(&[1.0, 3.0], &[1.25, 2.75]).unwrap();
        assert_eq!(
            (report.n, report.mae, report.mse, report.spearman),
            (2, 0.25, 0.0625, Some(1.0))
        );
        assert_eq!(report.constant_prediction, None);
    }
}
