//! Errors of a HU calibration.

use std::path::PathBuf;

use crate::matter::material_error::MaterialError;

/// Why a calibration cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// A calibration file cannot be used.
    #[error("HU calibration {}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: Box<CalibrationError>,
    },
    /// The file cannot be read.
    #[error("cannot be read")]
    Read(#[source] std::io::Error),
    /// The text is not a calibration.
    #[error("line {line}: {message}")]
    Syntax {
        /// The line, counted from 1.
        line: usize,
        /// What is wrong there.
        message: String,
    },
    /// There is nothing in it.
    #[error("the calibration has no [[segment]]")]
    Empty,
    /// A segment does not begin above the one before.
    #[error("segment {segment:?} {}, expected a number above {previous} HU", match found {
        Some(found) => format!("begins at {found} HU"),
        None => "has no `from_hu`".to_owned(),
    })]
    Start {
        /// The segment.
        segment: String,
        /// Where it begins.
        found: Option<f32>,
        /// Where the one before begins.
        previous: f32,
    },
    /// A segment without density.
    #[error("segment {segment:?} has no density knots [HU, g/cm³], expected at least one")]
    Knots {
        /// The segment.
        segment: String,
    },
    /// The density curve must rise in HU and never fall in density.
    #[error(
        "segment {segment:?}: knot {knot} of the density, {} HU and {} g/cm³, is not positive or does not continue the curve upwards",
        found[0], found[1]
    )]
    Curve {
        /// The segment.
        segment: String,
        /// The knot, counted from 1.
        knot: usize,
        /// HU and density found.
        found: [f32; 2],
    },
    /// The ends of a mixture have no rising densities.
    #[error(
        "segment {segment:?} mixes materials of {} and {} g/cm³, expected positive, rising densities",
        found[0], found[1]
    )]
    Mixture {
        /// The segment.
        segment: String,
        /// Densities given, g/cm³.
        found: [f32; 2],
    },
    /// A material of a segment does not exist.
    #[error("segment {segment:?}")]
    Material {
        /// The segment.
        segment: String,
        /// What is wrong with its material.
        source: Box<MaterialError>,
    },
}
