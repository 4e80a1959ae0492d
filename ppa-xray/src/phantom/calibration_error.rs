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
    /// The text is not a valid calibration.
    #[error("line {line}: {message}")]
    Syntax {
        /// Line number, from 1.
        line: usize,
        /// What is wrong with the line.
        message: String,
    },
    /// The calibration has no segments.
    #[error("the calibration has no [[segment]]")]
    Empty,
    /// A segment does not begin above the previous one.
    #[error("segment {segment:?} {}, expected a number above {previous} HU", match found {
        Some(found) => format!("begins at {found} HU"),
        None => "has no `from_hu`".to_owned(),
    })]
    Start {
        /// Name of the segment.
        segment: String,
        /// HU at which the segment begins.
        found: Option<f32>,
        /// HU at which the previous segment begins.
        previous: f32,
    },
    /// A segment has no density.
    #[error("segment {segment:?} has no density knots [HU, g/cm³], expected at least one")]
    Knots {
        /// Name of the segment.
        segment: String,
    },
    /// The density curve does not rise in HU, or falls in density.
    #[error(
        "segment {segment:?}: knot {knot} of the density, {} HU and {} g/cm³, is not positive or does not continue the curve upwards",
        found[0], found[1]
    )]
    Curve {
        /// Name of the segment.
        segment: String,
        /// Number of the knot, from 1.
        knot: usize,
        /// HU and density found.
        found: [f32; 2],
    },
    /// The densities of the ends of a mixture do not rise.
    #[error(
        "segment {segment:?} mixes materials of {} and {} g/cm³, expected positive, rising densities",
        found[0], found[1]
    )]
    Mixture {
        /// Name of the segment.
        segment: String,
        /// Densities given, g/cm³.
        found: [f32; 2],
    },
    /// A material of a segment is invalid.
    #[error("segment {segment:?}")]
    Material {
        /// Name of the segment.
        segment: String,
        /// What is wrong with the material.
        source: Box<MaterialError>,
    },
}
