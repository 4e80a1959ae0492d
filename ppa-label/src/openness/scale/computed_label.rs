//! The label that a scale gives an exposure.

use serde::Serialize;

/// Factors on the thresholds, which stand for stricter and more lenient readers.
pub(super) const VARIED: [f64; 3] = [0.75, 1.0, 4.0 / 3.0];

/// A label and its dependence on assumptions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ComputedLabel {
    /// Grade from 1 (ideal) to 3 (inadequate) in half steps: that of the worst gutter.
    pub label: f64,
    /// Half the range of grades under other thresholds and tolerances; not a reader's standard deviation.
    pub std: f64,
    /// Grades of the medial, the superior and the lateral gutter.
    pub gutters: [f64; 3],
    /// Quality of the worst gutter before grading, 0 to 1.
    pub worst: f64,
}

impl ComputedLabel {
    /// Builds a label from the grades of the gutters and the grades of the worst one under other thresholds and tolerances.
    pub(super) fn new(gutters: [f64; 3], varied: impl Iterator<Item = f64>, worst: f64) -> Self {
        let widen = |(low, high): (f64, f64), grade: f64| (low.min(grade), high.max(grade));
        let (low, high) = varied.fold((3.0, 1.0), widen);
        Self {
            label: gutters.into_iter().fold(1.0, f64::max),
            std: 0.5 * (high - low),
            gutters,
            worst,
        }
    }
}
