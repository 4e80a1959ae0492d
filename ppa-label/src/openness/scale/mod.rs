//! Quality scales for the visible joint space.

mod computed_label;
mod error;
mod graded;
mod name;
mod strict;

use std::path::Path;

use ppa_dataset::files::read_text;
use ppa_dataset::labels::LabelSource;
use serde::Serialize;
use serde::de::DeserializeOwned;

pub use self::computed_label::ComputedLabel;
pub use self::error::ScaleError;
pub use self::graded::GradedThresholds;
pub use self::name::{ScaleName, UnknownScale};
pub use self::strict::{OpennessReference, StrictThresholds};
use super::hidden::HiddenGutters;
use super::joint_space::Openness;

/// A scale with its thresholds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "scale", rename_all = "snake_case")]
pub enum LabelScale {
    /// Graded by how far the malleoli hide the gutters.
    Graded(GradedThresholds),
    /// Graded by how open the worst gutter is.
    Strict(StrictThresholds),
}

impl LabelScale {
    /// A scale with its default thresholds.
    pub fn new(name: ScaleName) -> Self {
        match name {
            ScaleName::Graded => Self::Graded(GradedThresholds::default()),
            ScaleName::Strict => Self::Strict(StrictThresholds::default()),
        }
    }

    /// Reads thresholds from TOML: `hidden_mm` and `lost_contrast` of the graded scale, `relative_to` (`"own_best"` or
    /// `"each_gutter"`) and `at_least` of the strict one; missing keys have their defaults.
    ///
    /// # Errors
    /// [`ScaleError`] naming the file, or thresholds out of order.
    pub fn read(name: ScaleName, path: &Path) -> Result<Self, ScaleError> {
        let read = match name {
            ScaleName::Graded => Self::Graded(thresholds(name, path)?),
            ScaleName::Strict => Self::Strict(thresholds(name, path)?),
        };
        read.check()?;
        Ok(read)
    }

    /// # Errors
    /// [`ScaleError`] for thresholds out of order.
    pub fn check(&self) -> Result<(), ScaleError> {
        match self {
            Self::Graded(thresholds) => thresholds.check(),
            Self::Strict(thresholds) => thresholds.check(),
        }
    }

    /// Grades an exposure.
    pub fn grade(&self, openness: &Openness, hidden: &HiddenGutters) -> ComputedLabel {
        match self {
            Self::Graded(thresholds) => thresholds.grade(openness, hidden),
            Self::Strict(thresholds) => thresholds.grade(openness),
        }
    }

    /// Source of the labels as named in files; `segmented` if `ppa prepare --segment-bones` separated the bones.
    pub(crate) fn source(&self, segmented: bool) -> LabelSource {
        match (self, segmented) {
            (Self::Graded(_), false) => LabelSource::Graded,
            (Self::Graded(_), true) => LabelSource::SegmentedGraded,
            (Self::Strict(_), false) => LabelSource::Strict,
            (Self::Strict(_), true) => LabelSource::SegmentedStrict,
        }
    }
}

fn thresholds<T: DeserializeOwned>(scale: ScaleName, path: &Path) -> Result<T, ScaleError> {
    toml::from_str(&read_text(path)?).map_err(|error| ScaleError::Parse {
        path: path.to_owned(),
        scale,
        message: error.message().to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(name: ScaleName, text: &str) -> Result<LabelScale, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("thresholds.toml");
        std::fs::write(&path, text).unwrap();
        LabelScale::read(name, &path).map_err(|error| error.to_string())
    }

    #[test]
    fn thresholds_are_read_for_their_scale() {
        use ScaleName::{Graded, Strict};
        for name in [Graded, Strict] {
            assert_eq!(read(name, ""), Ok(LabelScale::new(name)));
            assert_eq!(name.to_string().parse(), Ok(name));
        }
        let each = "relative_to = \"each_gutter\"\nat_least = [0.45, 0.3, 0.15, 0.02]";
        let expected = StrictThresholds {
            relative_to: OpennessReference::EachGutter,
            at_least: [0.45, 0.3, 0.15, 0.02],
        };
        assert_eq!(read(Strict, each), Ok(LabelScale::Strict(expected)));
        let wide = GradedThresholds {
            hidden_mm: [1.0, 3.0, 5.0, 7.0],
            ..GradedThresholds::default()
        };
        let found = read(Graded, "hidden_mm = [1, 3, 5, 7]");
        assert_eq!(found, Ok(LabelScale::Graded(wide)));
    }

    #[test]
    fn thresholds_out_of_order_are_refused() {
        use ScaleName::{Graded, Strict};
        for (name, wrong, expected) in [
            (
                Strict,
                "at_least = [0.4, 0.4, 0.2, 0.1]",
                "expected four decreasing",
            ),
            (
                Strict,
                "at_least = [1.1, 0.4, 0.2, 0.1]",
                "expected four decreasing",
            ),
            (
                Strict,
                "at_least = [0.9, 0.4, 0.2, nan]",
                "expected four decreasing",
            ),
            (
                Strict,
                "at_least = [0.9, 0.4, 0.2]",
                "thresholds.toml holds no thresholds",
            ),
            (
                Strict,
                "at_leats = [0.9, 0.4, 0.2, 0.1]",
                "unknown field `at_leats`",
            ),
            (
                Graded,
                "at_least = [0.9, 0.4, 0.2, 0.1]",
                "thresholds of the graded scale: ",
            ),
            (
                Graded,
                "hidden_mm = [1, 1, 2, 3]",
                "hidden_mm is 1, 1, 2, 3, expected four increasing",
            ),
            (
                Graded,
                "hidden_mm = [-1, 1, 2, 3]",
                "increasing numbers from 0 to 50",
            ),
            (
                Graded,
                "lost_contrast = [0.1, 0.2, 0.3, 1.1]",
                "increasing numbers from 0 to 1",
            ),
            (
                Graded,
                "lost_contrast = [0.1, 0.2, nan, 1]",
                "lost_contrast",
            ),
        ] {
            let said = read(name, wrong).unwrap_err();
            assert!(said.contains(expected), "{said}");
        }
        let error = "open".parse::<ScaleName>().unwrap_err().to_string();
        assert_eq!(error, "unknown scale \"open\", expected graded or strict");
    }
}
