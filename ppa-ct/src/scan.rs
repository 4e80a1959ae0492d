//! A scan as read: the volume, facts about its source and warnings.

use std::path::Path;

use serde::Serialize;

use crate::acquisition::Acquisition;
use crate::volume::Volume;

/// One CT as read from disk.
///
/// Has no field for a name, date, description or UID of its source.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// Hounsfield units in the `ct` frame.
    pub volume: Volume,
    /// Modality the source declares (`CT`); `None` for NIfTI and NRRD, which cannot declare one.
    pub modality: Option<String>,
    /// All DICOM series found, of which one was read; empty for other formats.
    pub series: Vec<SeriesSummary>,
    /// The source's statements about its acquisition.
    pub acquisition: Acquisition,
    /// Problems that did not prevent reading.
    pub warnings: Vec<Warning>,
}

/// A DICOM series, identified without its UID.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct SeriesSummary {
    /// Series Number, if the source has one.
    pub number: Option<i32>,
    /// Modality, e.g. `CT`.
    pub modality: Option<String>,
    /// Images of the series.
    pub slices: usize,
    /// Columns and rows of its first image.
    pub size: [usize; 2],
    /// Whether this is the series that was read.
    pub read: bool,
    /// Why it cannot be read, if one of its images is not a slice of a CT: in colour, or without a position.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refused: Option<String>,
}

/// Options for reading: which series, and what to accept.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ReadOptions {
    /// The DICOM series to read, if there are several.
    pub series: Option<SeriesChoice>,
    /// Fills gaps between DICOM slices by linear interpolation, with a warning, instead of refusing the series.
    pub fill_gaps: bool,
    /// Reads modalities other than CT and values in other units than HU, instead of refusing them.
    pub force: bool,
}

/// One series of several.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SeriesChoice {
    /// By Series Number.
    Number(i32),
    /// By Series Instance UID.
    Uid(String),
}

impl std::str::FromStr for SeriesChoice {
    type Err = &'static str;

    /// Parses an integer as a Series Number, and digits and points as a UID.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let is_uid = !text.is_empty() && text.chars().all(|c| c.is_ascii_digit() || c == '.');
        match text.parse() {
            Ok(number) => Ok(Self::Number(number)),
            Err(_) if is_uid => Ok(Self::Uid(text.to_owned())),
            Err(_) => Err("expected a series number or a series instance UID"),
        }
    }
}

/// A warning for the user about a scan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Warning {
    /// Stable code for scripts.
    pub code: WarningCode,
    /// One sentence for people.
    pub text: String,
}

/// Kinds of [`Warning`]; written in kebab-case, e.g. `gantry-tilt`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum WarningCode {
    /// The slice step is not along the slice normal; the affine is sheared.
    GantryTilt,
    /// One slice: its thickness is used as the step.
    SingleSlice,
    /// Localizers (scout views) were left out.
    LocalizersDropped,
    /// DICOM objects that are not images were left out.
    NonImagesDropped,
    /// A DICOMDIR lists files that do not exist, or files named or listed as DICOM are empty or damaged.
    FilesMissing,
    /// No rescale slope and intercept: stored values are taken as HU.
    NoRescale,
    /// The values do not look like Hounsfield units, or are stated to be something else.
    NotHu,
    /// Another modality than CT was read because the options asked for it.
    NotCt,
    /// Pixels without a measurement were set to air.
    PixelPadding,
    /// Slices were interpolated because the options asked for it.
    GapsFilled,
    /// The header of a file states no orientation or no position; the warning says what is assumed.
    NoOrientation,
}

/// Whether `DICM` follows a preamble of 128 bytes (DICOM PS3.10, section 7.1).
pub(crate) fn starts_as_dicom(path: &Path) -> std::io::Result<bool> {
    use std::io::Read;
    let mut start = Vec::with_capacity(132);
    ppa_core::regular_file::open(path)?
        .take(132)
        .read_to_end(&mut start)?;
    Ok(start.get(128..) == Some(b"DICM"))
}

/// Warns if no voxel is near air: every scan of a limb contains some.
#[cfg(any(
    feature = "dicom",
    feature = "nifti",
    feature = "nrrd",
    feature = "metaimage"
))]
pub(crate) fn hu_plausibility(volume: &Volume) -> Option<Warning> {
    /// Fat is about −100 HU and lung −850: if all values are above this, the volume has no air.
    const NO_AIR_HU: f32 = -200.0;
    let (min, max) = volume.values().range();
    let window = if min >= 0.0 && max <= 255.0 {
        "; this looks like an image windowed to 8 bits"
    } else {
        ""
    };
    (min > NO_AIR_HU).then(|| Warning {
        code: WarningCode::NotHu,
        text: format!(
            "values run from {min} to {max}, without air near -1000: probably not Hounsfield units{window}"
        ),
    })
}
