//! The strict scale: how open the worst gutter is.

use serde::{Deserialize, Serialize};

use super::computed_label::{ComputedLabel, VARIED};
use super::error::ScaleError;
use crate::openness::joint_space::Openness;

/// Reference that has openness 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OpennessReference {
    /// The worst gutter from the direction that opens all three of this foot best, so every foot has an ideal pose.
    #[default]
    OwnBest,
    /// Each gutter from the direction that opens it best, so a foot with diverging facets has no ideal pose.
    EachGutter,
}

/// Least openness of the worst gutter for each grade; below the last one the grade is 3.
///
/// No reader has set these numbers. With the defaults a pose is diagnostic (below 2.5) while the worst gutter shows a quarter of
/// what this foot can attain: in the phantoms up to about 5° either side of the best pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StrictThresholds {
    /// Reference of openness.
    pub relative_to: OpennessReference,
    /// Least openness for the grades 1, 1.5, 2 and 2.5: from 0 to 1, decreasing.
    pub at_least: [f64; 4],
}

impl Default for StrictThresholds {
    fn default() -> Self {
        Self {
            relative_to: OpennessReference::OwnBest,
            at_least: [0.75, 0.5, 0.25, 0.03],
        }
    }
}

impl StrictThresholds {
    /// # Errors
    /// [`ScaleError::Falling`] unless the thresholds decrease and are from 0 to 1.
    pub fn check(&self) -> Result<(), ScaleError> {
        let found = self.at_least;
        let falling = found.windows(2).all(|pair| pair[0] > pair[1]);
        let within = found.iter().all(|least| (0.0..=1.0).contains(least));
        if falling && within {
            Ok(())
        } else {
            Err(ScaleError::Falling(found))
        }
    }

    /// Grades an exposure by its worst gutter; the uncertainty follows from the three tolerances of
    /// [`FREE_CHORDS_MM`](crate::FREE_CHORDS_MM) and thresholds a quarter lower and a third higher.
    pub fn grade(&self, openness: &Openness) -> ComputedLabel {
        let worst = self.scaled(openness, openness.worst());
        let varied = worst
            .iter()
            .flat_map(|&worst| VARIED.map(|scale| self.of(worst, scale)));
        let gutter = |open: [f64; 3]| self.of(self.scaled(openness, open)[1], 1.0);
        let gutters = [openness.medial, [openness.superior; 3], openness.lateral].map(gutter);
        ComputedLabel::new(gutters, varied, worst[1])
    }

    /// The openness that thresholds apply to, for each of [`FREE_CHORDS_MM`](crate::FREE_CHORDS_MM).
    fn scaled(&self, openness: &Openness, found: [f64; 3]) -> [f64; 3] {
        match self.relative_to {
            OpennessReference::EachGutter => found,
            OpennessReference::OwnBest => std::array::from_fn(|n| match openness.attainable[n] {
                0.0 => 0.0,
                attainable => (found[n] / attainable).min(1.0),
            }),
        }
    }

    fn of(&self, open: f64, scale: f64) -> f64 {
        let missed = self.at_least.iter().filter(|&&least| open < scale * least);
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
            attainable: [0.5; 3],
        }
    }

    const EACH: StrictThresholds = StrictThresholds {
        relative_to: OpennessReference::EachGutter,
        at_least: [0.45, 0.3, 0.15, 0.02],
    };

    #[test]
    fn the_worst_gutter_decides_the_grade() {
        let label = |m, s, l| EACH.grade(&openness(m, s, l)).label;
        assert_eq!(label(0.9, 0.8, 0.45), 1.0);
        assert_eq!(label(0.9, 0.8, 0.449), 1.5);
        assert_eq!(label(0.2, 0.8, 0.9), 2.0);
        assert_eq!(label(0.9, 0.1, 0.9), 2.5);
        assert_eq!(label(0.9, 0.8, 0.0), 3.0);
    }

    #[test]
    fn every_foot_has_an_ideal_pose_when_its_own_best_counts() {
        let own = StrictThresholds {
            relative_to: OpennessReference::OwnBest,
            ..EACH
        };
        let label = |worst| own.grade(&openness(0.9, worst, 0.9)).label;
        // The best openness of this foot is 0.5.
        assert_eq!(label(0.5), 1.0);
        assert_eq!(label(0.225), 1.0);
        assert_eq!(label(0.22), 1.5);
        assert_eq!(label(0.0), 3.0);
        assert_eq!(EACH.grade(&openness(0.9, 0.225, 0.9)).label, 2.0);
    }

    #[test]
    fn uncertainty_is_half_the_range_of_assumptions() {
        // 0.4 is above 0.75 · 0.45 = 0.34 and not below 4/3 · 0.3 = 0.4: grades 1 to 1.5.
        assert_eq!(EACH.grade(&openness(0.4, 1.0, 1.0)).std, 0.25);
        assert_eq!(EACH.grade(&openness(0.9, 1.0, 1.0)).std, 0.0);
        let by_tolerance = Openness {
            medial: [0.0, 0.2, 0.9],
            ..openness(1.0, 1.0, 1.0)
        };
        let found = EACH.grade(&by_tolerance);
        assert_eq!((found.label, found.std), (2.0, 1.0));
    }
}
