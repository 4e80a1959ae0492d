//! The header of one DICOM file: its series and its slices.

use std::path::Path;
use std::sync::Arc;

use dicom_dictionary_std::{tags, uids};

use super::attributes::{Attributes, Groups};
use super::defined_terms;
use super::directory::{Listed, listed};
use super::file::{DicomFile, damaged, open};
use super::frame::Frame;
use super::stated::stated;
use super::stored::StoredFormat;
use crate::acquisition::Acquisition;
use crate::error::ReadError;

/// Contents of a DICOM file.
pub(super) enum Found {
    /// The slices of a CT, or of another modality that is to be read as CT.
    Slices(Series, Vec<Slice>),
    /// An image that cannot be part of its series, and why.
    Refused(Series, ReadError),
    /// An image of another modality; its geometry is not checked.
    OtherModality(Series),
    /// A scout view.
    Localizer,
    /// A DICOMDIR.
    Directory(Listed),
    /// A report, a plan.
    NotAnImage,
    /// A file that is named or listed as a slice, but does not begin as DICOM: empty or damaged.
    Damaged,
}

/// The series of an image. The UID is used only to group and choose files, and is not kept.
pub(super) struct Series {
    pub uid: String,
    pub number: Option<i32>,
    pub modality: Option<String>,
    /// Columns, rows.
    pub size: [usize; 2],
}

/// One slice: geometry and pixel encoding, pixels not yet read.
#[derive(Debug)]
pub(super) struct Slice {
    pub file: Arc<DicomFile>,
    /// Index of the frame in the file.
    pub index: usize,
    pub image: Image,
    pub frame: Frame,
    /// The file's statements about the acquisition.
    pub stated: Arc<Acquisition>,
}

/// Properties common to all frames of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Image {
    pub columns: usize,
    pub rows: usize,
    pub frames: usize,
    pub stored: StoredFormat,
}

impl Slice {
    /// Slope and intercept from stored values to HU.
    pub fn rescale(&self) -> [f64; 2] {
        self.frame.rescale.unwrap_or([1.0, 0.0])
    }
}

impl Image {
    pub fn pixels(&self) -> usize {
        self.columns * self.rows
    }

    /// Size of an uncompressed frame in bytes.
    pub fn native_bytes(&self) -> usize {
        self.pixels() * self.stored.bytes()
    }
}

/// Reads the header of `path`, up to the pixels; `force` treats any modality as CT.
pub(super) fn scan(path: &Path, force: bool) -> Result<Found, ReadError> {
    let opened = open(path)?;
    let data_set = opened.data_set()?;
    if opened.file.sop_class == uids::MEDIA_STORAGE_DIRECTORY_STORAGE {
        return Ok(Found::Directory(listed(path, &data_set)?));
    }
    let top = Attributes::of(path, &data_set);
    let series = match kind(&top, &opened.file.sop_class, force) {
        Kind::Slices(series) => series,
        Kind::Other(found) => return Ok(found),
    };
    let enhanced = opened.file.sop_class == uids::ENHANCED_CT_IMAGE_STORAGE;
    let described =
        image(&top).and_then(|image| Ok((image, frames(&top, image.frames, enhanced)?)));
    // Whether that matters is decided when a series is chosen.
    let (image, frames) = match described {
        Ok(described) => described,
        Err(error) => return Ok(Found::Refused(series, error)),
    };
    let stated = Arc::new(stated(&top, &image, frames.first()));
    let file = Arc::new(opened.file);
    let slices = frames.into_iter().enumerate().map(|(index, frame)| Slice {
        file: Arc::clone(&file),
        index,
        image,
        frame,
        stated: Arc::clone(&stated),
    });
    Ok(Found::Slices(series, slices.collect()))
}

enum Kind {
    Slices(Series),
    Other(Found),
}

fn kind(top: &Attributes, sop_class: &str, force: bool) -> Kind {
    let ct_classes = [uids::CT_IMAGE_STORAGE, uids::ENHANCED_CT_IMAGE_STORAGE, ""];
    if !ct_classes.contains(&sop_class) && top.data_set.get(tags::ROWS).is_none() {
        return Kind::Other(Found::NotAnImage);
    }
    let side = |tag| usize::from(top.word(tag).unwrap_or_default());
    let series = Series {
        uid: top.text(tags::SERIES_INSTANCE_UID).unwrap_or_default(),
        number: top.text(tags::SERIES_NUMBER).and_then(|n| n.parse().ok()),
        modality: top
            .text(tags::MODALITY)
            .map(|m| defined_terms::modality(&m).to_owned()),
        size: [side(tags::COLUMNS), side(tags::ROWS)],
    };
    let Some(modality) = &series.modality else {
        let error = top.missing("Modality");
        return Kind::Other(Found::Refused(series, error));
    };
    if modality != "CT" && !force {
        return Kind::Other(Found::OtherModality(series));
    }
    let image_type = top.text(tags::IMAGE_TYPE).unwrap_or_default();
    if image_type.split('\\').any(|v| v.trim() == "LOCALIZER") {
        return Kind::Other(Found::Localizer);
    }
    Kind::Slices(series)
}

fn image(top: &Attributes) -> Result<Image, ReadError> {
    let [rows, columns] = [
        top.needed_word(tags::ROWS, "Rows")?,
        top.needed_word(tags::COLUMNS, "Columns")?,
    ];
    if rows == 0 || columns == 0 {
        return Err(top.bad("Rows", format!("{rows} x {columns}"), "at least one pixel"));
    }
    let photometric = top.text(tags::PHOTOMETRIC_INTERPRETATION);
    if let Some(other) =
        photometric.filter(|p| !["MONOCHROME1", "MONOCHROME2"].contains(&p.as_str()))
    {
        return Err(top.bad(
            "PhotometricInterpretation",
            defined_terms::photometric(&other).to_owned(),
            "MONOCHROME1 or MONOCHROME2 (grey)",
        ));
    }
    let samples = top.needed_word(tags::SAMPLES_PER_PIXEL, "SamplesPerPixel")?;
    if samples != 1 {
        return Err(top.bad("SamplesPerPixel", samples.to_string(), "1 (grey)"));
    }
    let frames = match top.optional(tags::NUMBER_OF_FRAMES, "NumberOfFrames")? {
        None => 1,
        Some(frames) if frames >= 1.0 && frames.fract() == 0.0 => frames as usize,
        Some(frames) => {
            let expected = "a whole number above 0";
            return Err(top.bad("NumberOfFrames", frames.to_string(), expected));
        }
    };
    Ok(Image {
        columns: columns.into(),
        rows: rows.into(),
        frames,
        stored: StoredFormat::of(top)?,
    })
}

/// The frames in the order of the file, each with the groups that apply to it.
fn frames(top: &Attributes, count: usize, enhanced: bool) -> Result<Vec<Frame>, ReadError> {
    let fault = |fault| damaged(top.path, fault);
    let items = |sequence| top.data_set.items(sequence).map_err(fault);
    let groups = |sequence| {
        let groups = items(sequence)?.iter().map(Groups::of).collect();
        let groups: Result<Vec<_>, _> = groups;
        groups.map_err(fault)
    };
    let shared = groups(tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE)?;
    let per_frame = groups(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE)?;
    let mappings = items(tags::REAL_WORLD_VALUE_MAPPING_SEQUENCE)?;
    if (count > 1 || enhanced) && per_frame.len() != count {
        return Err(ReadError::MultiFrame {
            path: top.path.to_owned(),
            frames: count,
            described: per_frame.len(),
        });
    }
    (0..count)
        .map(|index| {
            let groups = per_frame.get(index).into_iter().chain(shared.first());
            Frame::of(&Attributes {
                groups: groups.collect(),
                mappings: &mappings,
                ..*top
            })
        })
        .collect()
}
