//! From openness to the quality scale.

use serde::{Deserialize, Serialize};

use super::joint_space::Openness;

/// How open the worst gutter must be for a grade; below the last one the grade is 3.
///
/// No reader has set these numbers. The defaults call a pose diagnostic (below 2.5) while the worst gutter shows a seventh of
/// what it could, about 5° either side of the best pose for a gutter of usual shape.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GradeThresholds {
    /// Least openness for the grades 1, 1.5, 2 and 2.5: from 0 to 1, falling.
    pub at_least: [f64; 4],
}

impl Default for GradeThresholds {
    fn default() -> Self {
        Self {
            at_least: [0.45, 0.3, 0.15, 0.02],
        }
    }
}

/// A label and how far it depends on what was assumed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ComputedLabel {
    /// Grade from 1 (ideal) to 3 (inadequate) in half steps.
    pub label: f64,
    /// Half the range of grades that other tolerances and thresholds give; not a reader's standard deviation.
    pub std: f64,
}

/// Why thresholds are none.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("thresholds of openness are {found:?}, expected four falling numbers from 0 to 1")]
pub struct ThresholdError {
    found: [f64; 4],
}

impl GradeThresholds {
    /// # Errors
    /// [`ThresholdError`] unless the thresholds fall and lie from 0 to 1.
    pub fn check(&self) -> Result<(), ThresholdError> {
        let found = self.at_least;
        let falling = found.windows(2).all(|pair| pair[0] > pair[1]);
        let within = found.iter().all(|least| (0.0..=1.0).contains(least));
        if falling && within {
            Ok(())
        } else {
            Err(ThresholdError { found })
        }
    }

    /// The grade of an exposure by its worst gutter; the uncertainty from the three tolerances of
    /// [`FREE_CHORDS_MM`](super::FREE_CHORDS_MM) and thresholds a quarter lower and a third higher.
    pub fn grade(&self, openness: &Openness) -> ComputedLabel {
        let worst = openness.worst();
        let varied = worst
            .iter()
            .flat_map(|&worst| [0.75, 1.0, 4.0 / 3.0].map(|scale| self.of(worst, scale)));
        let (low, high) = varied.fold((3.0, 1.0), |(low, high): (f64, f64), grade| {
            (low.min(grade), high.max(grade))
        });
        ComputedLabel {
            label: self.of(worst[1], 1.0),
            std: 0.5 * (high - low),
        }
    }

    fn of(&self, worst: f64, scale: f64) -> f64 {
        let missed = self.at_least.iter().filter(|&&least| worst < scale * least);
        1.0 + 0.5 * missed.count() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn openness(medial: f64, superior: f64, lateral: f64) -> Openness {
        Openness {
            medial: [medial; 3],
            superior,
            lateral: [lateral; 3],
        }
    }

    #[test]
    fn the_worst_gutter_decides_and_thresholds_belong_to_the_better_grade() {
        let thresholds = GradeThresholds::default();
        let label = |m, s, l| thresholds.grade(&openness(m, s, l)).label;
        assert_eq!(label(0.9, 0.8, 0.45), 1.0);
        assert_eq!(label(0.9, 0.8, 0.449), 1.5);
        assert_eq!(label(0.2, 0.8, 0.9), 2.0);
        assert_eq!(label(0.9, 0.1, 0.9), 2.5);
        assert_eq!(label(0.9, 0.8, 0.0), 3.0);
    }

    #[test]
    fn uncertainty_is_half_the_range_of_what_might_have_been_assumed() {
        let thresholds = GradeThresholds::default();
        // 0.4 is above 0.75 · 0.45 = 0.34 and not below 4/3 · 0.3 = 0.4: grades 1 to 1.5.
        assert_eq!(thresholds.grade(&openness(0.4, 1.0, 1.0)).std, 0.25);
        assert_eq!(thresholds.grade(&openness(0.9, 1.0, 1.0)).std, 0.0);
        let by_tolerance = Openness {
            medial: [0.0, 0.2, 0.9],
            superior: 1.0,
            lateral: [1.0; 3],
        };
        let found = thresholds.grade(&by_tolerance);
        assert_eq!((found.label, found.std), (2.0, 1.0));
    }

    #[test]
    fn thresholds_fall_within_0_and_1() {
        let check = |at_least| GradeThresholds { at_least }.check();
        assert!(GradeThresholds::default().check().is_ok());
        for wrong in [
            [0.4, 0.4, 0.2, 0.1],
            [1.1, 0.4, 0.2, 0.1],
            [0.9, 0.4, 0.2, f64::NAN],
        ] {
            assert!(check(wrong).is_err(), "{wrong:?}");
        }
    }
}
