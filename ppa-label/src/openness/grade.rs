//! From openness to the quality scale.

use std::path::{Path, PathBuf};

use ppa_dataset::files::{FileError, read_text};
use serde::{Deserialize, Serialize};

use super::joint_space::Openness;

/// What an openness of 1 stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GradeScale {
    /// The worst gutter from the direction that opens all three of this foot best: every foot has an ideal pose.
    #[default]
    OwnBest,
    /// Each gutter from the direction that opens it best: a foot whose facets part has no ideal pose.
    EachGutter,
}

/// How open the worst gutter must be for a grade; below the last one the grade is 3.
///
/// No reader has set these numbers. With the defaults a pose is diagnostic (below 2.5) while the worst gutter shows a quarter of
/// what this foot can attain: in the phantoms up to about 5° either side of the best pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GradeThresholds {
    /// What openness is relative to.
    pub relative_to: GradeScale,
    /// Least openness for the grades 1, 1.5, 2 and 2.5: from 0 to 1, falling.
    pub at_least: [f64; 4],
}

impl Default for GradeThresholds {
    fn default() -> Self {
        Self {
            relative_to: GradeScale::OwnBest,
            at_least: [0.75, 0.5, 0.25, 0.03],
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
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ThresholdError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file holds something else.
    #[error("{} holds no thresholds: {message}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// What is wrong and where.
        message: String,
    },
    /// Numbers out of order.
    #[error("thresholds of openness are {}, expected four falling numbers from 0 to 1", ppa_core::text::numbers(*.0))]
    Order([f64; 4]),
}

impl GradeThresholds {
    /// Reads thresholds from TOML: `relative_to` (`"own_best"` or `"each_gutter"`) and `at_least`; what is left out has its default.
    ///
    /// # Errors
    /// [`ThresholdError`] naming the file, or unless the thresholds fall and lie from 0 to 1.
    pub fn read(path: &Path) -> Result<Self, ThresholdError> {
        let read: Self =
            toml::from_str(&read_text(path)?).map_err(|error| ThresholdError::Parse {
                path: path.to_owned(),
                message: error.to_string().trim_end().to_owned(),
            })?;
        read.check()?;
        Ok(read)
    }

    /// # Errors
    /// [`ThresholdError`] unless the thresholds fall and lie from 0 to 1.
    pub fn check(&self) -> Result<(), ThresholdError> {
        let found = self.at_least;
        let falling = found.windows(2).all(|pair| pair[0] > pair[1]);
        let within = found.iter().all(|least| (0.0..=1.0).contains(least));
        if falling && within {
            Ok(())
        } else {
            Err(ThresholdError::Order(found))
        }
    }

    /// The grade of an exposure by its worst gutter; the uncertainty from the three tolerances of
    /// [`FREE_CHORDS_MM`](super::FREE_CHORDS_MM) and thresholds a quarter lower and a third higher.
    pub fn grade(&self, openness: &Openness) -> ComputedLabel {
        let worst = self.scaled(openness);
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

    /// The openness that thresholds apply to, for each of [`FREE_CHORDS_MM`](super::FREE_CHORDS_MM).
    pub fn scaled(&self, openness: &Openness) -> [f64; 3] {
        let worst = openness.worst();
        match self.relative_to {
            GradeScale::EachGutter => worst,
            GradeScale::OwnBest => std::array::from_fn(|n| match openness.attainable[n] {
                0.0 => 0.0,
                attainable => (worst[n] / attainable).min(1.0),
            }),
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
            attainable: [0.5; 3],
        }
    }

    const EACH: GradeThresholds = GradeThresholds {
        relative_to: GradeScale::EachGutter,
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
        let own = GradeThresholds {
            relative_to: GradeScale::OwnBest,
            ..EACH
        };
        let label = |worst| own.grade(&openness(0.9, worst, 0.9)).label;
        // The best that this foot shows is 0.5.
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

    #[test]
    fn thresholds_are_read_and_fall_within_0_and_1() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("thresholds.toml");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            GradeThresholds::read(&path).map_err(|error| error.to_string())
        };
        assert_eq!(read(""), Ok(GradeThresholds::default()));
        let each = "relative_to = \"each_gutter\"\nat_least = [0.45, 0.3, 0.15, 0.02]";
        assert_eq!(read(each), Ok(EACH));
        for (wrong, expected) in [
            ("at_least = [0.4, 0.4, 0.2, 0.1]", "expected four falling"),
            ("at_least = [1.1, 0.4, 0.2, 0.1]", "expected four falling"),
            ("at_least = [0.9, 0.4, 0.2, nan]", "expected four falling"),
            (
                "at_least = [0.9, 0.4, 0.2]",
                "thresholds.toml holds no thresholds",
            ),
            (
                "at_leats = [0.9, 0.4, 0.2, 0.1]",
                "unknown field `at_leats`",
            ),
        ] {
            let said = read(wrong).unwrap_err();
            assert!(said.contains(expected), "{said}");
        }
    }
}
