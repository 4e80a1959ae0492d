//! The graded scale: how far the malleoli hide the gutters.

use serde::{Deserialize, Serialize};

use super::computed_label::{ComputedLabel, VARIED};
use super::error::ScaleError;
use crate::openness::hidden::HiddenGutters;
use crate::openness::joint_space::Openness;

/// How much of a gutter may be hidden for a grade; beyond the last one the grade is 3. The worst gutter decides.
///
/// A radiographer accepts a mortise view if all three gutters are open and no malleolus lies over the talus (Wheeless' Textbook of
/// Orthopaedics, "Mortise view"). What lies over it is graded linearly: 4.5 mm ends the diagnostic range, [1, 2.5), and the other
/// thresholds are where a line from 1 at 0 mm is rounded to another half step.
///
/// No reader has set these numbers. `hidden_mm` is fitted to one figure: readers in the paper (Laufer et al., MELBA 2026:027) called
/// about 41 % of the poses from 0° to 90° diagnostic, which follows from the sensitivity, specificity and accuracy of its table 1. In
/// the 17 phantoms 4.5 mm give 41 % (95 % of bootstrap samples of the feet: 39 to 43 %), a window of 37°, and best angles of 19° on
/// average (17° to 21°); 41 % ask for 4.1 to 5.0 mm. `lost_contrast` is not fitted: rotation hardly closes the superior gutter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GradedThresholds {
    /// By how many mm a malleolus may cover the talus for the grades 1, 1.5, 2 and 2.5, on average over the height of the gutter:
    /// rising, at most 50.
    pub hidden_mm: [f64; 4],
    /// How much the superior gutter may lose of its best contrast: rising, from 0 to 1.
    pub lost_contrast: [f64; 4],
}

impl Default for GradedThresholds {
    fn default() -> Self {
        Self {
            hidden_mm: [0.9, 2.7, 4.5, 6.3],
            lost_contrast: [0.1, 0.3, 0.5, 0.7],
        }
    }
}

impl GradedThresholds {
    /// # Errors
    /// [`ScaleError::Rising`] naming thresholds that do not rise or lie outside their range.
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

    /// The grade of an exposure by its worst gutter; the uncertainty from thresholds a quarter lower and a third higher.
    pub fn grade(&self, openness: &Openness, hidden: &HiddenGutters) -> ComputedLabel {
        let gutters = |scale: f64| {
            let exceeded = |limits: [f64; 4], found: f64| {
                let exceeded = limits.iter().filter(|&&limit| found > scale * limit);
                1.0 + 0.5 * exceeded.count() as f64
            };
            [
                exceeded(self.hidden_mm, hidden.medial.mean_mm),
                exceeded(self.lost_contrast, 1.0 - openness.superior),
                exceeded(self.hidden_mm, hidden.lateral.mean_mm),
            ]
        };
        let worst = |scale: f64| gutters(scale).into_iter().fold(1.0, f64::max);
        let varied = VARIED.into_iter().map(worst);
        let most_mm = hidden.medial.mean_mm.max(hidden.lateral.mean_mm);
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
        let hidden = |mean_mm: f64| Hidden {
            share: if mean_mm > 0.0 { 1.0 } else { 0.0 },
            mean_mm,
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
        assert_eq!(grade(0.9, 0.95, 0.0).label, 1.0);
        assert_eq!(grade(1.0, 1.0, 0.0).label, 1.5);
        assert_eq!(grade(0.0, 1.0, 4.5).label, 2.0);
        assert_eq!(grade(5.0, 1.0, 0.0).label, 2.5);
        assert_eq!(grade(0.0, 0.2, 0.0).label, 3.0);
        let found = grade(2.0, 0.6, 7.0);
        assert_eq!((found.label, found.gutters), (3.0, [1.5, 2.0, 3.0]));
        assert_eq!((found.worst, grade(0.0, 1.0, 0.0).worst), (0.0, 1.0));
    }

    #[test]
    fn uncertainty_is_half_the_range_of_thresholds() {
        // 3 mm: above 2.7 mm, below 3.6 mm (a third higher), below 3.375 mm (a quarter lower than 4.5 mm).
        assert_eq!(grade(3.0, 1.0, 0.0).std, 0.25);
        // 4.6 mm: 2 to 2.5.
        assert_eq!(grade(4.6, 1.0, 0.0).std, 0.25);
        assert_eq!(grade(0.0, 1.0, 0.0).std, 0.0);
        assert_eq!(grade(20.0, 1.0, 0.0).std, 0.0);
    }

    #[test]
    fn half_steps_are_those_of_a_rounded_line() {
        let third = GradedThresholds::default().hidden_mm[2];
        for (mm, n) in [(0.1, 0), (1.7, 1), (3.5, 2), (5.3, 3), (7.1, 4)] {
            let line: f64 = 1.0 + 1.25 * mm / third;
            assert_eq!((2.0 * line).round() / 2.0, 1.0 + 0.5 * f64::from(n));
            assert_eq!(grade(mm, 1.0, 0.0).label, 1.0 + 0.5 * f64::from(n));
        }
    }
}
