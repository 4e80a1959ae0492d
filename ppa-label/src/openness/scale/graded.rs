//! The graded scale: how far the malleoli hide the gutters.

use serde::{Deserialize, Serialize};

use super::computed_label::{ComputedLabel, VARIED};
use super::error::ScaleError;
use crate::openness::hidden::HiddenGutters;
use crate::openness::joint_space::Openness;

/// Largest hidden part of a gutter for each grade; beyond the last one the grade is 3. The worst gutter decides.
///
/// A radiographer accepts a mortise view if all three gutters are open and no malleolus lies over the talus (Wheeless' Textbook of
/// Orthopaedics, "Mortise view"). An overlap is graded linearly: the diagnostic range, [1, 2.5), ends at 3.75 mm, and the other
/// thresholds are where a line from 1 at 0 mm is rounded to another half step.
///
/// No reader has set these numbers. `hidden_mm` is fitted to one figure: readers in the paper (Laufer et al., MELBA 2026:027) called
/// about 41 % of the poses from 0° to 90° diagnostic, which follows from the sensitivity, specificity and accuracy of its table 1. In
/// the 17 phantoms, whose axis is inclined by 4° to the detector as when they lie on a table, 3.75 mm give 41 %, a window of 37°, and
/// best angles of 20° on average (95 % of bootstrap samples of the feet: 17° to 22.5°); 41 % would need 3.8 mm (3.4 to 4.2 mm). With axes
/// parallel to the detector 3.75 mm give 36 %. `lost_contrast` is not fitted: rotation hardly closes the superior gutter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GradedThresholds {
    /// Largest overlap of a malleolus with the talus for the grades 1, 1.5, 2 and 2.5, as the median over the height of the
    /// gutter, mm: increasing, at most 50.
    pub hidden_mm: [f64; 4],
    /// Largest loss of the superior gutter's best contrast for these grades: increasing, from 0 to 1.
    pub lost_contrast: [f64; 4],
}

impl Default for GradedThresholds {
    fn default() -> Self {
        Self {
            hidden_mm: [0.75, 2.25, 3.75, 5.25],
            lost_contrast: [0.1, 0.3, 0.5, 0.7],
        }
    }
}

impl GradedThresholds {
    /// # Errors
    /// [`ScaleError::Rising`] naming thresholds that do not increase or are out of range.
    pub fn check(&self) -> Result<(), ScaleError> {
        let rise = |key, found: [f64; 4], most| {
            let rising = found.windows(2).all(|pair| pair[0] < pair[1]);
            let within = found.iter().all(|limit| (0.0..=most).contains(limit));
            match rising && within {
                true => Ok(()),
                false => Err(ScaleError::Rising { key, found, most }),
            }
        };
        rise("hidden_mm", self.hidden_mm, 50.0)?;
        rise("lost_contrast", self.lost_contrast, 1.0)
    }

    /// Grades an exposure by its worst gutter; the uncertainty follows from thresholds a quarter lower and a third higher.
    pub fn grade(&self, openness: &Openness, hidden: &HiddenGutters) -> ComputedLabel {
        let gutters = |scale: f64| {
            let exceeded = |limits: [f64; 4], found: f64| {
                let exceeded = limits.iter().filter(|&&limit| found > scale * limit);
                1.0 + 0.5 * exceeded.count() as f64
            };
            [
                exceeded(self.hidden_mm, hidden.medial.median_mm),
                exceeded(self.lost_contrast, 1.0 - openness.superior),
                exceeded(self.hidden_mm, hidden.lateral.median_mm),
            ]
        };
        let worst = |scale: f64| gutters(scale).into_iter().fold(1.0, f64::max);
        let varied = VARIED.into_iter().map(worst);
        let most_mm = hidden.medial.median_mm.max(hidden.lateral.median_mm);
        let lost =
            (most_mm / self.hidden_mm[3]).max((1.0 - openness.superior) / self.lost_contrast[3]);
        ComputedLabel::new(gutters(1.0), varied, 1.0 - lost.min(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::openness::hidden::Hidden;

    fn grade(medial_mm: f64, superior: f64, lateral_mm: f64) -> ComputedLabel {
        let hidden = |median_mm: f64| Hidden {
            share: if median_mm > 0.0 { 1.0 } else { 0.0 },
            median_mm,
        };
        let openness = Openness {
            medial: [0.0; 3],
            superior,
            lateral: [0.0; 3],
            attainable: [0.5; 3],
        };
        let hidden = HiddenGutters {
            medial: hidden(medial_mm),
            lateral: hidden(lateral_mm),
        };
        GradedThresholds::default().grade(&openness, &hidden)
    }

    #[test]
    fn the_worst_gutter_decides_the_grade() {
        assert_eq!(grade(0.0, 1.0, 0.0).label, 1.0);
        assert_eq!(grade(0.75, 0.95, 0.0).label, 1.0);
        assert_eq!(grade(1.0, 1.0, 0.0).label, 1.5);
        assert_eq!(grade(0.0, 1.0, 3.75).label, 2.0);
        assert_eq!(grade(4.0, 1.0, 0.0).label, 2.5);
        assert_eq!(grade(0.0, 0.2, 0.0).label, 3.0);
        let found = grade(2.0, 0.6, 7.0);
        assert_eq!((found.label, found.gutters), (3.0, [1.5, 2.0, 3.0]));
        assert_eq!((found.worst, grade(0.0, 1.0, 0.0).worst), (0.0, 1.0));
    }

    #[test]
    fn uncertainty_is_half_the_range_of_thresholds() {
        // 2.5 mm: 2, above 2.25 mm; 1.5 if the threshold is 3 mm; still 2 if the next one is 2.8 mm.
        assert_eq!(grade(2.5, 1.0, 0.0).std, 0.25);
        // 2.9 mm: 2; 1.5 below 3 mm; 2.5 above 2.8 mm.
        assert_eq!(grade(2.9, 1.0, 0.0).std, 0.5);
        assert_eq!(grade(0.0, 1.0, 0.0).std, 0.0);
        assert_eq!(grade(20.0, 1.0, 0.0).std, 0.0);
    }

    #[test]
    fn half_steps_are_those_of_a_rounded_line() {
        let third = GradedThresholds::default().hidden_mm[2];
        for (mm, n) in [(0.1, 0), (1.4, 1), (2.9, 2), (4.4, 3), (5.9, 4)] {
            let line: f64 = 1.0 + 1.25 * mm / third;
            assert_eq!((2.0 * line).round() / 2.0, 1.0 + 0.5 * f64::from(n));
            assert_eq!(grade(mm, 1.0, 0.0).label, 1.0 + 0.5 * f64::from(n));
        }
    }
}
