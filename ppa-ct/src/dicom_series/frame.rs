//! Position of one slice in space, and the unit of its values.

use dicom_dictionary_std::tags;
use nalgebra::{Point3, Vector3};

use super::attributes::Attributes;
use super::defined_terms;
use crate::error::ReadError;

/// Largest cosine between row and column directions accepted as a right angle in files read and written: some
/// writers round direction cosines to three digits.
pub(crate) const RIGHT_ANGLE: f64 = 5e-3;

/// Geometry and units of one slice.
#[derive(Debug)]
pub(super) struct Frame {
    /// Centre of the first pixel, LPS mm.
    pub position: Point3<f64>,
    /// Unit direction of increasing column index (along a row).
    pub along_row: Vector3<f64>,
    /// Unit direction of increasing row index (down a column).
    pub down_column: Vector3<f64>,
    /// Distance between neighbouring columns and between neighbouring rows, mm.
    pub spacing_mm: [f64; 2],
    /// Slice Thickness; only used if there is no second slice to measure the step with.
    pub thickness_mm: Option<f64>,
    /// Slope and intercept from stored values to HU.
    pub rescale: Option<[f64; 2]>,
    /// Unit of the values, if the header says that they are not HU.
    pub foreign_unit: Option<&'static str>,
}

impl Frame {
    pub fn of(attributes: &Attributes) -> Result<Self, ReadError> {
        let [x, y, z] = attributes.numbers(tags::IMAGE_POSITION_PATIENT, "ImagePositionPatient")?;
        let cosines: [f64; 6] =
            attributes.numbers(tags::IMAGE_ORIENTATION_PATIENT, "ImageOrientationPatient")?;
        let [along_row, down_column] =
            [0, 3].map(|at| Vector3::from_column_slice(&cosines[at..at + 3]));
        let unit = |v: Vector3<f64>| (v.norm() - 1.0).abs() < RIGHT_ANGLE;
        let square = along_row.dot(&down_column).abs() < RIGHT_ANGLE;
        if !(unit(along_row) && unit(down_column) && square) {
            return Err(attributes.bad(
                "ImageOrientationPatient",
                ppa_core::text::numbers(cosines).to_string(),
                "two perpendicular unit vectors",
            ));
        }
        // Pixel Spacing lists the distance between rows first (PS3.3, section 10.7.1.3).
        let [between_rows, between_columns] =
            attributes.numbers(tags::PIXEL_SPACING, "PixelSpacing")?;
        if !(between_rows > 0.0 && between_columns > 0.0) {
            return Err(attributes.bad(
                "PixelSpacing",
                format!("{between_rows}\\{between_columns}"),
                "two positive distances",
            ));
        }
        Ok(Self {
            position: Point3::new(x, y, z),
            along_row: along_row.normalize(),
            down_column: down_column.normalize(),
            spacing_mm: [between_columns, between_rows],
            thickness_mm: attributes
                .optional(tags::SLICE_THICKNESS, "SliceThickness")?
                .filter(|t| *t > 0.0),
            rescale: rescale(attributes)?,
            foreign_unit: foreign_unit(attributes)?,
        })
    }
}

fn rescale(attributes: &Attributes) -> Result<Option<[f64; 2]>, ReadError> {
    let slope = attributes.optional(tags::RESCALE_SLOPE, "RescaleSlope")?;
    let intercept = attributes.optional(tags::RESCALE_INTERCEPT, "RescaleIntercept")?;
    match (slope, intercept) {
        (None, None) => Ok(None),
        (Some(0.0), _) => Err(attributes.bad("RescaleSlope", "0".to_owned(), "another number")),
        (Some(slope), Some(intercept)) => Ok(Some([slope, intercept])),
        (None, _) => Err(attributes.missing("RescaleSlope")),
        (_, None) => Err(attributes.missing("RescaleIntercept")),
    }
}

/// A rescale type or real-world unit other than HU.
fn foreign_unit(attributes: &Attributes) -> Result<Option<&'static str>, ReadError> {
    let rescale_type = attributes.text(tags::RESCALE_TYPE);
    // US: unspecified (PS3.3, section C.11.1.1.2).
    let rescale_type = rescale_type.filter(|text| text != "US");
    let unit = attributes.real_world_unit()?;
    let stated = [rescale_type, unit].into_iter().flatten();
    let mut foreign = stated.filter(|text| !is_hounsfield(text));
    Ok(foreign.next().map(|text| defined_terms::unit(&text)))
}

/// Whether a text means Hounsfield units; writers differ in case and blanks, and some spell the words out.
fn is_hounsfield(text: &str) -> bool {
    let letters = text.chars().filter(char::is_ascii_alphanumeric);
    let letters = letters.map(|c| c.to_ascii_uppercase()).collect::<String>();
    // `[hnsf'U]` in UCUM.
    [
        "HU",
        "HNSFU",
        "HOUNSFIELD",
        "HOUNSFIELDUNIT",
        "HOUNSFIELDUNITS",
    ]
    .contains(&letters.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hounsfield_units_are_known_by_their_spellings() {
        for text in [
            "HU",
            "hu",
            " Hu ",
            "H.U.",
            "HOUNSFIELD",
            "Hounsfield units",
            "[hnsf'U]",
        ] {
            assert!(is_hounsfield(text), "{text}");
        }
        for text in ["HU_MOD", "mg/ml", "MGML", "Z_EFF", "EDW", "normalized", "1"] {
            assert!(!is_hounsfield(text), "{text}");
        }
    }
}
