//! Interpolated slices that fill the gaps of a stack.

use std::path::Path;

use nalgebra::{Point3, Vector3};

use super::steps::{OFF_LATTICE_MM, OFF_LATTICE_STEPS, steps};
use crate::error::ReadError;
use crate::scan::{Warning, WarningCode};

/// Largest ratio of slices in a filled stack to slices found: above it, most of the stack would be interpolated.
const MOST_PER_SLICE: usize = 8;

/// A position between two slices of a stack.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::dicom_series) struct Between {
    /// The slice below, counted in order; the other is the next slice.
    pub below: usize,
    /// Weight of the other slice, 0 to 1.
    pub weight: f32,
}

/// Makes an even lattice from the first to the last of uneven positions, and places its slices between them.
///
/// # Errors
/// [`ReadError::TooManyGaps`] if that needs far more slices than exist.
pub(super) fn fill(
    source: &Path,
    positions: &[Point3<f64>],
) -> Result<(Vector3<f64>, Vec<Between>), ReadError> {
    let last = positions.len() - 1;
    let whole = positions[last] - positions[0];
    let along = |p: &Point3<f64>| (p - positions[0]).dot(&whole) / whole.norm();
    let along = positions.iter().map(along).collect::<Vec<_>>();
    let usual_mm = steps(positions).1;
    let count = (whole.norm() / usual_mm).round().max(1.0);
    let most = MOST_PER_SLICE * positions.len();
    // Written so that infinity is also refused.
    let few = count + 1.0 <= most as f64;
    if !few {
        return Err(ReadError::TooManyGaps {
            path: source.to_owned(),
            slices: positions.len(),
            needed: count + 1.0,
            most,
        });
    }
    let step = whole / count;
    let mut above = 1;
    let places = (0..=count as usize).map(|k| {
        let height = k as f64 * step.norm();
        while above < last && along[above] <= height {
            above += 1;
        }
        let [low, high] = [along[above - 1], along[above]];
        let weight = ((height - low) / (high - low)).clamp(0.0, 1.0);
        // Rounded positions do not blur existing slices.
        let slack = OFF_LATTICE_MM.min(OFF_LATTICE_STEPS * usual_mm) / (high - low);
        let weight = if weight < slack {
            0.0
        } else if weight > 1.0 - slack {
            1.0
        } else {
            weight
        };
        Between {
            below: above - 1,
            weight: weight as f32,
        }
    });
    Ok((step, places.collect()))
}

/// The warning about interpolated slices.
pub(super) fn filled(found: usize, places: &[Between]) -> Warning {
    let made = places.iter().filter(|p| !matches!(p.weight, 0.0 | 1.0));
    Warning {
        code: WarningCode::GapsFilled,
        text: format!(
            "{found} slices are not evenly spaced: {} of the {} slices here are interpolated between their neighbours",
            made.count(),
            places.len()
        ),
    }
}
