//! Why a scan could not be read.

use std::path::{Path, PathBuf};

use ppa_core::text::{count, number};

use super::Cause;
use crate::scan::SeriesSummary;
use crate::volume_error::VolumeError;

/// Why a scan could not be read.
///
/// Messages name files and numbers only, never what a header says about a person.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file or folder cannot be opened or read.
    #[error("cannot read {}", path.display())]
    Io {
        /// The path asked for.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// Neither a folder of DICOM files, nor a DICOM file, nor NIfTI, NRRD or MetaImage.
    #[error("{} is not a scan that ppa can read: expected a folder with one DICOM series, a DICOM file, .nii, .nii.gz, .nrrd, .nhdr, .mha or .mhd", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
    },
    /// The crate was built without this reader.
    #[error("{} needs the feature `{feature}` of ppa-ct, which this build lacks", path.display())]
    FeatureOff {
        /// The file or folder.
        path: PathBuf,
        /// Cargo feature that holds the reader.
        feature: &'static str,
    },
    /// A folder without a single DICOM image.
    #[error("no DICOM image in {} ({files} files examined, including subfolders){}", path.display(), other_format(volume.as_deref()))]
    NoDicom {
        /// The folder.
        path: PathBuf,
        /// Number of files in it.
        files: usize,
        /// The first file in the folder itself that has the name of another format.
        volume: Option<PathBuf>,
    },
    /// A DICOMDIR none of whose files exists.
    #[error("{} is a DICOM directory, but none of the {missing} files that it lists exists below its folder", path.display())]
    EmptyDirectory {
        /// The directory.
        path: PathBuf,
        /// Number of files that it lists.
        missing: usize,
    },
    /// A file that starts as DICOM cannot be parsed to the end.
    #[error("{} is damaged or not a valid DICOM file", path.display())]
    Dicom {
        /// The file.
        path: PathBuf,
        /// The parser's error.
        source: Cause,
    },
    /// A missing attribute that is needed for the geometry or the pixel values.
    #[error("{} lacks {tag}", path.display())]
    MissingTag {
        /// The file.
        path: PathBuf,
        /// DICOM keyword.
        tag: &'static str,
    },
    /// An attribute with an unusable value.
    #[error("{}: {tag} is {found}, expected {expected}", path.display())]
    BadTag {
        /// The file.
        path: PathBuf,
        /// DICOM keyword.
        tag: &'static str,
        /// The value.
        found: String,
        /// The expected value.
        expected: &'static str,
    },
    /// Another modality than CT: its values are not Hounsfield units.
    #[error("{} holds modality {modality}, not CT; its values are not Hounsfield units and are read only when forced", path.display())]
    NotCt {
        /// The modality found.
        modality: String,
        /// The file or folder.
        path: PathBuf,
    },
    /// A CT whose header gives its values another unit than HU, as in maps of blood flow.
    #[error("{} holds values in {unit}, not in Hounsfield units; they are read only when forced", path.display())]
    NotHu {
        /// The file.
        path: PathBuf,
        /// Rescale Type or UCUM code.
        unit: &'static str,
    },
    /// More than one series to choose from.
    #[error("{} holds {} series, expected one or a choice by number or UID: {}", path.display(), series.len(), list_series(series))]
    SeveralSeries {
        /// The folder.
        path: PathBuf,
        /// All series, by number.
        series: Vec<SeriesSummary>,
    },
    /// The chosen series does not exist.
    #[error("{} does not hold the chosen series; it holds {}", path.display(), list_series(series))]
    NoSuchSeries {
        /// The folder or file.
        path: PathBuf,
        /// All series present, by number.
        series: Vec<SeriesSummary>,
    },
    /// Nothing but localizers (scout views).
    #[error("{} holds {} but no slices", path.display(), count(*localizers, "localizer image"))]
    OnlyLocalizers {
        /// The folder.
        path: PathBuf,
        /// Number of localizers.
        localizers: usize,
    },
    /// A multi-frame object that does not state the positions of its frames.
    #[error("{} holds {} but positions for {described} of them", path.display(), count(*frames, "frame"))]
    MultiFrame {
        /// The file.
        path: PathBuf,
        /// Number of frames.
        frames: usize,
        /// Frames with functional groups of their own.
        described: usize,
    },
    /// No decoder for the encoding of the pixels.
    #[error("cannot decode the pixels of {}: transfer syntax {name} ({uid})", path.display())]
    TransferSyntax {
        /// The file.
        path: PathBuf,
        /// Transfer syntax UID; it names an encoding, never a person.
        uid: String,
        /// Name of the transfer syntax.
        name: &'static str,
        /// The decoder's error.
        source: Cause,
    },
    /// The size of the pixel data does not match the header, or they are compressed more than is plausible.
    #[error("{} holds {found} bytes of pixel data, which do not match the {expected} bytes specified by its header", path.display())]
    PixelCount {
        /// The file.
        path: PathBuf,
        /// Bytes found, compressed or not.
        found: u64,
        /// Bytes expected from the header, not compressed.
        expected: u64,
    },
    /// Slices of one series that do not fit on one lattice.
    #[error("{}: {what} is {found}, but {expected} in the other slices", path.display())]
    Mixed {
        /// First file that differs.
        path: PathBuf,
        /// What differs.
        what: &'static str,
        /// Its value in that file.
        found: String,
        /// The value in the first slice.
        expected: String,
    },
    /// Several slices at the same position, as in a series with phases or without true positions.
    #[error(
        "{}: {slices} slices share the position ({:.3}, {:.3}, {:.3}) mm; distinct positions of all {total}: {positions}",
        path.display(), number(position_mm[0]), number(position_mm[1]), number(position_mm[2])
    )]
    SamePosition {
        /// The folder.
        path: PathBuf,
        /// Number of slices at the most crowded position.
        slices: usize,
        /// That position, LPS.
        position_mm: [f64; 3],
        /// Total number of slices.
        total: usize,
        /// Number of distinct positions.
        positions: usize,
    },
    /// Slices are missing, or their steps vary.
    #[error("the slices in {} are not evenly spaced: expected steps of {expected_mm:.3} mm, found {}; gaps are filled only when asked for", path.display(), list_gaps(gaps))]
    UnevenSteps {
        /// The folder.
        path: PathBuf,
        /// Usual distance between neighbours (the median).
        expected_mm: f64,
        /// Steps that differ.
        gaps: Vec<Gap>,
    },
    /// Slices whose positions are not on one line.
    #[error("the slices in {} do not lie on one line: slice {slice} is {off_mm:.3} mm off the line from the first to the last", path.display())]
    Sideways {
        /// The folder.
        path: PathBuf,
        /// The slice farthest from the line, counted from 0 along the slice normal.
        slice: usize,
        /// Distance from the line.
        off_mm: f64,
    },
    /// Gaps that would take far more slices to fill than exist.
    #[error("filling the gaps between the {slices} slices in {} would give {needed:.0} slices, expected at most {most}", path.display())]
    TooManyGaps {
        /// The folder.
        path: PathBuf,
        /// Slices present.
        slices: usize,
        /// Slices of the even stack.
        needed: f64,
        /// Largest number of slices of an even stack.
        most: usize,
    },
    /// A NIfTI, NRRD or MetaImage file with an unusable header.
    #[error("{}: {problem}", path.display())]
    Header {
        /// The file.
        path: PathBuf,
        /// What was found and what was expected.
        problem: String,
    },
    /// The values or the affine do not form a volume.
    #[error("{} does not hold a usable volume", path.display())]
    Volume {
        /// The file or folder.
        path: PathBuf,
        /// The cause.
        source: VolumeError,
    },
}

/// A step between two neighbouring slices that differs from the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    /// Slice before the step, counted from 0 along the slice normal.
    pub after_slice: usize,
    /// Length of the step.
    pub found_mm: f64,
}

impl ReadError {
    /// Describes what is wrong with an image, without the name of the file.
    #[cfg(feature = "dicom")]
    pub(crate) fn without_path(&self) -> String {
        match self {
            Self::MissingTag { tag, .. } => format!("lacks {tag}"),
            Self::BadTag {
                tag,
                found,
                expected,
                ..
            } => format!("{tag} is {found}, expected {expected}"),
            Self::MultiFrame {
                frames, described, ..
            } => format!(
                "{} but positions for {described} of them",
                count(*frames, "frame")
            ),
            _ => "damaged".to_owned(),
        }
    }
}

fn list_series(series: &[SeriesSummary]) -> String {
    let names = series.iter().map(|s| {
        let number = s.number.map_or("?".to_owned(), |n| n.to_string());
        let modality = s.modality.as_deref().unwrap_or("no modality");
        let [columns, rows] = s.size;
        let refused = s.refused.as_ref();
        let refused = refused.map_or(String::new(), |reason| format!(", refused: {reason}"));
        format!(
            "number {number} ({modality}, {} of {columns} x {rows}{refused})",
            count(s.slices, "image")
        )
    });
    match series {
        [] => "no series at all".to_owned(),
        _ => names.collect::<Vec<_>>().join("; "),
    }
}

fn list_gaps(gaps: &[Gap]) -> String {
    const SHOWN: usize = 5;
    let mut text = gaps
        .iter()
        .take(SHOWN)
        .map(|gap| format!("{:.3} mm after slice {}", gap.found_mm, gap.after_slice))
        .collect::<Vec<_>>()
        .join(", ");
    if gaps.len() > SHOWN {
        text += &format!(" and {} more", gaps.len() - SHOWN);
    }
    text
}

/// Hint at a file in a folder without DICOM that can be read by itself.
fn other_format(volume: Option<&Path>) -> String {
    match volume {
        Some(file) => format!("; name the file {} itself to read it", file.display()),
        None => String::new(),
    }
}
