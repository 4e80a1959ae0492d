//! The label that a scale gives an exposure.

use serde::Serialize;

/// Thresholds are taken a quarter lower and a third higher as well: stricter and more lenient readers.
pub(super) const VARIED: [f64; 3] = [0.75, 1.0, 4.0 / 3.0];

/// A label and how far it depends on what was assumed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ComputedLabel {
    /// Grade from 1 (ideal) to 3 (inadequate) in half steps: that of the worst gutter.
    pub label: f64,
    /// Half the range of grades that other thresholds and tolerances give; not a reader's standard deviation.
    pub std: f64,
    /// Grades of the medial, the superior and the lateral gutter.
    pub gutters: [f64; 3],
    /// How good the worst gutter is before it is graded, 0 to 1.
    pub worst: f64,
}

impl ComputedLabel {
    /// From the grades of the gutters, and those of the worst one that other thresholds and tolerances give.
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
