//! Errors of predicted corrections.

use serde::Serialize;

use super::row::Row;

/// Errors of the corrections that a network predicts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CorrectionScores {
    /// Number of images whose correction is both predicted and known.
    pub n: usize,
    /// Mean absolute error in degrees.
    pub mae_deg: f64,
    /// Mean error in degrees: positive if predictions rotate too far medially.
    pub bias_deg: f64,
}

impl CorrectionScores {
    /// Returns `None` if no correction is both predicted and known.
    pub(super) fn of(rows: &[Row]) -> Option<Self> {
        let error = |row: &Row| Some(row.predicted_correction_deg? - row.correction_deg?);
        let errors: Vec<f64> = rows.iter().filter_map(error).collect();
        let n = errors.len();
        let mean =
            |error: fn(f64) -> f64| errors.iter().copied().map(error).sum::<f64>() / n as f64;
        (n > 0).then(|| Self {
            n,
            mae_deg: mean(f64::abs),
            bias_deg: mean(|error| error),
        })
    }
}
