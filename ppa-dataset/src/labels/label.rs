//! The label of one radiograph.

use serde::{Deserialize, Serialize};

/// Source of a label.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum LabelSource {
    /// People who looked at the radiograph.
    #[serde(rename = "readers")]
    Readers,
    /// Openness of the joint space, strict scale: a surrogate that no reader has confirmed.
    #[serde(rename = "surrogate-jso/1")]
    Strict,
    /// The same from bones that `ppa prepare --segment-bones` separated in the scan.
    #[serde(rename = "surrogate-jso/1-segmented")]
    SegmentedStrict,
    /// How far the malleoli hide the gutters, graded scale: a surrogate that no reader has confirmed.
    #[serde(rename = "surrogate-jso/2")]
    Graded,
    /// The same from bones that `ppa prepare --segment-bones` separated in the scan.
    #[serde(rename = "surrogate-jso/2-segmented")]
    SegmentedGraded,
}

impl LabelSource {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Readers => "readers",
            Self::Strict => "surrogate-jso/1",
            Self::SegmentedStrict => "surrogate-jso/1-segmented",
            Self::Graded => "surrogate-jso/2",
            Self::SegmentedGraded => "surrogate-jso/2-segmented",
        }
    }

    /// Whether no reader gave the label.
    pub fn is_computed(self) -> bool {
        self != Self::Readers
    }
}

/// The sources of the labels in one file: readers and at most one kind of computed labels, or only unknown sources.
#[derive(Debug, Default)]
pub(crate) struct Sources(Vec<Option<LabelSource>>);

impl Sources {
    /// Adds the source of another label; the error is the name of a source in this file that it is incompatible with.
    pub fn take(&mut self, source: Option<LabelSource>) -> Result<(), &'static str> {
        let beside = |other: &&Option<LabelSource>| match (source, **other) {
            (Some(a), Some(b)) => a == b || (a.is_computed() != b.is_computed()),
            (a, b) => a == b,
        };
        if let Some(other) = self.0.iter().find(|other| !beside(other)) {
            return Err(name_of(*other));
        }
        if !self.0.contains(&source) {
            self.0.push(source);
        }
        Ok(())
    }
}

/// The name of a source in words.
pub(crate) fn name_of(source: Option<LabelSource>) -> &'static str {
    source.map_or("an unnamed source", LabelSource::name)
}

/// The label of one radiograph.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LabelRow {
    /// Quality from 1 (ideal) to 3 (inadequate): the mean over the readers.
    pub label: f64,
    /// Spread of the label. Readers: standard deviation dividing by their number (ddof 0), as published.
    pub std: f64,
    /// Half degrees of medial rotation.
    pub step: u32,
}

impl LabelRow {
    /// Mean and standard deviation (ddof 0) of grades; `None` if there are none.
    pub fn of_grades(grades: &[f64], step: u32) -> Option<Self> {
        let n = grades.len() as f64;
        let label = grades.iter().sum::<f64>() / n;
        let variance = grades.iter().map(|g| (g - label).powi(2)).sum::<f64>() / n;
        (!grades.is_empty()).then(|| Self {
            label,
            std: variance.sqrt(),
            step,
        })
    }

    pub(super) fn check(&self, image: &str) -> Result<(), LabelError> {
        let at = || image.to_owned();
        if !(1.0..=3.0).contains(&self.label) {
            return Err(LabelError::Label(at(), self.label));
        }
        // The standard deviation of grades from 1 to 3 is at most 1.
        if !(0.0..=1.0).contains(&self.std) {
            return Err(LabelError::Std(at(), self.std));
        }
        let expected = radiograph_name(self.step);
        if image != expected {
            return Err(LabelError::Step(at(), self.step));
        }
        if self.step > LAST_STEP {
            return Err(LabelError::Angle(at(), f64::from(self.step) / 2.0));
        }
        Ok(())
    }
}

/// The last possible step of a sweep: 180 degrees.
const LAST_STEP: u32 = 360;

/// The name of a radiograph, the key of `labels.json`.
pub(super) fn radiograph_name(step: u32) -> String {
    format!("xray_image_{step}.png")
}

/// Why a label is invalid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LabelError {
    /// Off the scale.
    #[error("{0} has the label {1}, expected 1 to 3")]
    Label(String, f64),
    /// A spread that grades from 1 to 3 cannot have.
    #[error("{0} has the std {1}, expected 0 to 1")]
    Std(String, f64),
    /// Name and step differ.
    #[error("{0} has the step {1}, expected the step in its name, xray_image_STEP.png")]
    Step(String, u32),
    /// Beyond the rotations of the layout.
    #[error("{0} is at {1} degrees, expected a multiple of 0.5 from 0 to 180")]
    Angle(String, f64),
    /// Labels of incompatible sources.
    #[error(
        "{image} is labelled by {found}, others by {expected}; a file can hold labels of readers and computed labels of one kind only"
    )]
    Mixed {
        /// The radiograph.
        image: String,
        /// Its source.
        found: &'static str,
        /// The source of an earlier one.
        expected: &'static str,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Grades of four readers in half steps: the only ones that give the published 1.5 and 0.35355, ddof 0.
    #[test]
    fn mean_and_spread_are_those_published() {
        let row = LabelRow::of_grades(&[1.0, 1.5, 1.5, 2.0], 36).unwrap();
        assert_eq!(row.label, 1.5);
        assert!((row.std - 0.353_55).abs() < 5e-6);
        assert_eq!(LabelRow::of_grades(&[], 36), None);
        assert_eq!(LabelRow::of_grades(&[1.0, 3.0], 36).unwrap().std, 1.0);
    }
}
