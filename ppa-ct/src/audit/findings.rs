//! Findings of an audit.

use std::fmt;

use serde::Serialize;

use ppa_core::text::count;

use crate::acquisition::Acquisition;
use crate::scan::{Warning, WarningCode};

/// One finding about a scan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Stable code for scripts.
    pub code: FindingCode,
    /// Severity of the finding.
    pub severity: Severity,
    /// What was found, in one sentence.
    pub text: String,
    /// What it means for depth images made from the scan.
    pub depth_images: &'static str,
    /// What it means for radiographs made from the scan.
    pub radiographs: &'static str,
}

/// How much a finding matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// Good to know; nothing to do.
    Note,
    /// Look at the scan before using it.
    Caution,
    /// Do not use the scan as it is.
    Severe,
}

impl fmt::Display for Severity {
    /// As in JSON.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// Kinds of [`Finding`]; written in kebab-case, e.g. `metal`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum FindingCode {
    /// The voxel axes are a left-handed system.
    LeftHanded,
    /// Voxels are large for a limb.
    CoarseVoxels,
    /// Slices are thinner than their distance: some tissue was never imaged.
    GapsBetweenSlices,
    /// Slices are thicker than their distance.
    OverlappingSlices,
    /// The source was compressed with loss.
    LossyPixels,
    /// All values are shifted: a rescale intercept is missing or wrong.
    ShiftedValues,
    /// No air near −1000 HU.
    NoAir,
    /// The peak of air is off −1000 HU.
    AirOffScale,
    /// No soft tissue.
    NoTissue,
    /// The peak of soft tissue is off its expected HU.
    TissueOffScale,
    /// No bone.
    NoBone,
    /// Values at the upper end are clipped.
    ClippedAbove,
    /// Values at the lower end are clipped well above air.
    ClippedBelow,
    /// Values below air: padding that is stored as a number.
    BelowAir,
    /// Metal.
    Metal,
    /// A couch-like plate.
    Couch,
    /// The couch is not where the stated patient position implies.
    CouchMisplaced,
    /// The field of view cuts tissue at a side.
    CutAtSide,
    /// The field of view ends within the limb.
    CutAtEnd,
    /// Attributes of the source identify somebody or something.
    Identifiers,
    /// A warning of a reader, under the reader's own code.
    #[serde(untagged)]
    Reader(WarningCode),
}

impl Finding {
    pub(super) fn new(code: FindingCode, severity: Severity, text: String) -> Self {
        let (depth_images, radiographs) = code.meaning();
        Self {
            code,
            severity,
            text,
            depth_images,
            radiographs,
        }
    }

    /// Converts a warning of a reader to a finding.
    pub(super) fn of_warning(warning: &Warning) -> Self {
        let severity = match warning.code {
            WarningCode::LocalizersDropped
            | WarningCode::NonImagesDropped
            | WarningCode::PixelPadding => Severity::Note,
            WarningCode::NotHu | WarningCode::NotCt | WarningCode::SingleSlice => Severity::Severe,
            _ => Severity::Caution,
        };
        Self::new(
            FindingCode::Reader(warning.code),
            severity,
            warning.text.clone(),
        )
    }
}

/// Finding on the identifying attributes present, without their values.
pub(super) fn identifiers(acquisition: &Acquisition) -> Option<Finding> {
    /// Largest number of names listed.
    const SHOWN: usize = 8;
    let names = acquisition.identifiers.iter().copied().collect::<Vec<_>>();
    let mut list = names
        .iter()
        .take(SHOWN)
        .copied()
        .collect::<Vec<_>>()
        .join(", ");
    if names.len() > SHOWN {
        list += &format!(" and {} more", names.len() - SHOWN);
    }
    (!names.is_empty()).then(|| {
        Finding::new(
            FindingCode::Identifiers,
            Severity::Note,
            format!(
                "the source identifies a person, a place, a date or an instance by {}: {list}",
                count(names.len(), "attribute")
            ),
        )
    })
}
