//! Metrics of labels and predictions.

use serde::Serialize;

/// The metrics of `ppa-metrics`; `None` for those that are not defined for these labels.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scores {
    /// Number of predictions.
    pub n: usize,
    /// Mean squared error.
    pub mse: Option<f64>,
    /// Mean absolute error.
    pub mae: Option<f64>,
    /// Spearman's rank correlation; `None` if all labels or all predictions are equal.
    pub spearman: Option<f64>,
    /// Share with |error| < 0.5.
    pub accuracy: Option<f64>,
    /// Share of predictions on the same side of 2.5 as the label.
    pub diagnostic_accuracy: Option<f64>,
    /// Share of the non-diagnostic labels that are predicted as such; `None` if there are none.
    pub sensitivity: Option<f64>,
    /// Share of the diagnostic labels that are predicted as such; `None` if there are none.
    pub specificity: Option<f64>,
}

impl Scores {
    /// Computes the metrics of pairs of label and prediction.
    pub fn of(pairs: &[(f64, f64)]) -> Self {
        let (labels, predictions): (Vec<f64>, Vec<f64>) = pairs.iter().copied().unzip();
        let [x, y] = [&labels[..], &predictions[..]];
        Self {
            n: pairs.len(),
            mse: ppa_metrics::mse(x, y).ok(),
            mae: ppa_metrics::mae(x, y).ok(),
            spearman: ppa_metrics::spearman(x, y).ok(),
            accuracy: ppa_metrics::accuracy(x, y).ok(),
            diagnostic_accuracy: ppa_metrics::diagnostic_accuracy(x, y).ok(),
            sensitivity: ppa_metrics::sensitivity(x, y).ok(),
            specificity: ppa_metrics::specificity(x, y).ok(),
        }
    }
}
