//! What the header of one DICOM file says: which series, where in space, how to read the pixels.

use std::path::{Path, PathBuf};

use dicom_core::Tag;
use dicom_dictionary_std::{tags, uids};
use dicom_object::DefaultDicomObject;
use nalgebra::{Point3, Vector3};

use super::open::{Extent, open};
use super::stated::acquisition;
use crate::acquisition::Acquisition;
use crate::error::ReadError;

/// What a DICOM file turned out to be.
pub(super) enum Found {
    /// A slice of a CT.
    Slice(Series, Box<Slice>),
    /// An image of another modality; its geometry is not looked at.
    OtherModality(Series),
    /// A scout view.
    Localizer,
    /// A report, a plan, a directory.
    NotAnImage,
}

/// Which series an image belongs to. The UID only groups files and goes no further.
pub(super) struct Series {
    pub uid: String,
    pub number: Option<i32>,
    pub modality: Option<String>,
}

/// One CT slice: geometry and pixel encoding, pixels not yet read.
#[derive(Debug, Clone)]
pub(super) struct Slice {
    pub path: PathBuf,
    pub rows: usize,
    pub columns: usize,
    /// Centre of the first pixel, LPS mm.
    pub position: Point3<f64>,
    /// Unit direction of increasing column index (along a row).
    pub along_row: Vector3<f64>,
    /// Unit direction of increasing row index (down a column).
    pub down_column: Vector3<f64>,
    /// Distance between neighbouring columns and between neighbouring rows, mm.
    pub spacing_mm: [f64; 2],
    /// Slice Thickness; only used where there is no second slice to measure the step with.
    pub thickness_mm: Option<f64>,
    /// Slope and intercept from stored values to HU.
    pub rescale: Option<[f64; 2]>,
    /// Rescale Type, where it is neither HU nor unspecified.
    pub foreign_unit: Option<String>,
    pub pixel: PixelFormat,
    /// What the header says about the acquisition.
    pub stated: Acquisition,
}

/// How a stored value sits in its container (DICOM PS3.5, section 8.1.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PixelFormat {
    /// 8, 16 or 32.
    pub bits_allocated: u32,
    /// Bits that carry the value.
    pub bits_stored: u32,
    /// Position of the topmost of them.
    pub high_bit: u32,
    pub signed: bool,
}

/// Reads the header of `path`, up to the pixels.
pub(super) fn scan(path: &Path) -> Result<Found, ReadError> {
    let object = open(path, Extent::Header)?;
    Header {
        path,
        object: &object,
    }
    .classify()
}

struct Header<'a> {
    path: &'a Path,
    object: &'a DefaultDicomObject,
}

impl Header<'_> {
    fn classify(&self) -> Result<Found, ReadError> {
        let sop_class = self.object.meta().media_storage_sop_class_uid();
        let sop_class = sop_class.trim_end_matches(['\0', ' ']);
        let is_ct = matches!(
            sop_class,
            uids::CT_IMAGE_STORAGE | uids::ENHANCED_CT_IMAGE_STORAGE | ""
        );
        if !is_ct && self.object.get(tags::ROWS).is_none() {
            return Ok(Found::NotAnImage);
        }
        let modality = self.text(tags::MODALITY).filter(|m| is_code(m));
        let series = Series {
            uid: self.text(tags::SERIES_INSTANCE_UID).unwrap_or_default(),
            number: self.text(tags::SERIES_NUMBER).and_then(|n| n.parse().ok()),
            modality,
        };
        let Some(modality) = &series.modality else {
            return Err(self.missing("Modality"));
        };
        if modality != "CT" {
            return Ok(Found::OtherModality(series));
        }
        let image_type = self.text(tags::IMAGE_TYPE).unwrap_or_default();
        if image_type.split('\\').any(|v| v.trim() == "LOCALIZER") {
            return Ok(Found::Localizer);
        }
        let frames = match self.text(tags::NUMBER_OF_FRAMES) {
            Some(_) => self.whole(tags::NUMBER_OF_FRAMES, "NumberOfFrames")?,
            None => 1,
        };
        if frames > 1 || sop_class == uids::ENHANCED_CT_IMAGE_STORAGE {
            return Err(ReadError::MultiFrame {
                path: self.path.to_owned(),
                frames,
            });
        }
        Ok(Found::Slice(series, Box::new(self.slice()?)))
    }

    fn slice(&self) -> Result<Slice, ReadError> {
        let [x, y, z] = self.numbers(tags::IMAGE_POSITION_PATIENT, "ImagePositionPatient")?;
        let cosines: [f64; 6] =
            self.numbers(tags::IMAGE_ORIENTATION_PATIENT, "ImageOrientationPatient")?;
        let [along_row, down_column] =
            [0, 3].map(|at| Vector3::from_column_slice(&cosines[at..at + 3]));
        // Written with up to 16 digits, but some writers round to 3.
        let unit = |v: Vector3<f64>| (v.norm() - 1.0).abs() < 5e-3;
        if !(unit(along_row) && unit(down_column) && along_row.dot(&down_column).abs() < 5e-3) {
            return Err(self.bad(
                "ImageOrientationPatient",
                format!("{cosines:?}"),
                "two perpendicular unit vectors",
            ));
        }
        // Pixel Spacing gives the distance between rows first (PS3.3, section 10.7.1.3).
        let [between_rows, between_columns] = self.numbers(tags::PIXEL_SPACING, "PixelSpacing")?;
        if !(between_rows > 0.0 && between_columns > 0.0) {
            return Err(self.bad(
                "PixelSpacing",
                format!("{between_rows}\\{between_columns}"),
                "two positive distances",
            ));
        }
        let [rows, columns] = [
            self.whole(tags::ROWS, "Rows")?,
            self.whole(tags::COLUMNS, "Columns")?,
        ];
        if rows == 0 || columns == 0 {
            return Err(self.bad("Rows", format!("{rows} x {columns}"), "at least one pixel"));
        }
        let samples = self.whole(tags::SAMPLES_PER_PIXEL, "SamplesPerPixel")?;
        if samples != 1 {
            return Err(self.bad("SamplesPerPixel", samples.to_string(), "1 (grey)"));
        }
        let (rescale, pixel) = (self.rescale()?, self.pixel_format()?);
        Ok(Slice {
            path: self.path.to_owned(),
            rows: rows as usize,
            columns: columns as usize,
            position: Point3::new(x, y, z),
            along_row: along_row.normalize(),
            down_column: down_column.normalize(),
            spacing_mm: [between_columns, between_rows],
            thickness_mm: self
                .optional(tags::SLICE_THICKNESS, "SliceThickness")?
                .filter(|t| *t > 0.0),
            rescale,
            foreign_unit: self
                .text(tags::RESCALE_TYPE)
                .filter(|t| is_code(t) && !matches!(t.as_str(), "HU" | "US")),
            pixel,
            stated: acquisition(self.object, pixel, rescale.unwrap_or([1.0, 0.0])),
        })
    }

    fn rescale(&self) -> Result<Option<[f64; 2]>, ReadError> {
        let slope = self.optional(tags::RESCALE_SLOPE, "RescaleSlope")?;
        let intercept = self.optional(tags::RESCALE_INTERCEPT, "RescaleIntercept")?;
        match (slope, intercept) {
            (None, None) => Ok(None),
            (Some(0.0), _) => Err(self.bad("RescaleSlope", "0".to_owned(), "another number")),
            (Some(slope), Some(intercept)) => Ok(Some([slope, intercept])),
            (None, _) => Err(self.missing("RescaleSlope")),
            (_, None) => Err(self.missing("RescaleIntercept")),
        }
    }

    fn pixel_format(&self) -> Result<PixelFormat, ReadError> {
        let format = PixelFormat {
            bits_allocated: self.whole(tags::BITS_ALLOCATED, "BitsAllocated")?,
            bits_stored: self.whole(tags::BITS_STORED, "BitsStored")?,
            high_bit: self.whole(tags::HIGH_BIT, "HighBit")?,
            signed: self.whole(tags::PIXEL_REPRESENTATION, "PixelRepresentation")? == 1,
        };
        let fits = (1..=format.bits_allocated).contains(&format.bits_stored)
            && (format.bits_stored - 1..format.bits_allocated).contains(&format.high_bit);
        if !matches!(format.bits_allocated, 8 | 16 | 32) || !fits {
            return Err(self.bad(
                "BitsAllocated",
                format!(
                    "{} with {} bits stored up to bit {}",
                    format.bits_allocated, format.bits_stored, format.high_bit
                ),
                "8, 16 or 32 with the stored bits inside",
            ));
        }
        Ok(format)
    }

    /// An attribute as text without padding; `None` when it is absent or empty.
    fn text(&self, tag: Tag) -> Option<String> {
        let text = self.object.get(tag)?.to_str().ok()?;
        let text = text.trim_matches(|c: char| c.is_whitespace() || c == '\0');
        (!text.is_empty()).then(|| text.to_owned())
    }

    fn whole(&self, tag: Tag, name: &'static str) -> Result<u32, ReadError> {
        let element = self.object.get(tag).ok_or_else(|| self.missing(name))?;
        element.to_int().map_err(|_| {
            let found = element.to_str().unwrap_or_else(|_| "unreadable".into());
            self.bad(name, found.into_owned(), "a whole number, not negative")
        })
    }

    fn optional(&self, tag: Tag, name: &'static str) -> Result<Option<f64>, ReadError> {
        match self.text(tag) {
            None => Ok(None),
            Some(_) => self.numbers::<1>(tag, name).map(|[value]| Some(value)),
        }
    }

    fn numbers<const N: usize>(&self, tag: Tag, name: &'static str) -> Result<[f64; N], ReadError> {
        let text = self.text(tag).ok_or_else(|| self.missing(name))?;
        let values = self.object.get(tag).and_then(|e| e.to_multi_float64().ok());
        values
            .and_then(|values| <[f64; N]>::try_from(values).ok())
            .filter(|values| values.iter().all(|v| v.is_finite()))
            .ok_or_else(|| self.bad(name, text, "finite numbers of the standard's count"))
    }

    fn missing(&self, tag: &'static str) -> ReadError {
        ReadError::MissingTag {
            path: self.path.to_owned(),
            tag,
        }
    }

    fn bad(&self, tag: &'static str, found: String, expected: &'static str) -> ReadError {
        ReadError::BadTag {
            path: self.path.to_owned(),
            tag,
            found,
            expected,
        }
    }
}

/// Whether a text is a DICOM code string, so that no free text passes on as one (PS3.5, table 6.2-1).
fn is_code(text: &str) -> bool {
    let allowed = |c: char| c.is_ascii_uppercase() || c.is_ascii_digit() || matches!(c, '_' | ' ');
    text.len() <= 16 && text.chars().all(allowed)
}
