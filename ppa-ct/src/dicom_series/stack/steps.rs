//! Distances between neighbouring slices, and whether they are equal.

use std::path::Path;

use nalgebra::{Point3, Vector3};

use crate::error::{Gap, ReadError};

/// Distance below which two slices are at the same position.
const SAME_PLACE_MM: f64 = 1e-3;
/// Largest distance of a slice from its place on the lattice: positions rounded to 0.1 mm pass.
pub(super) const OFF_LATTICE_MM: f64 = 0.1;
/// The same for small steps, as a fraction of the step; one missing slice moves others by 0.5.
pub(super) const OFF_LATTICE_STEPS: f64 = 0.2;

/// Refuses slices at the same position; `heights` are those of `positions` along the normal, ascending.
pub(super) fn distinct_places(
    source: &Path,
    positions: &[Point3<f64>],
    heights: &[f64],
) -> Result<(), ReadError> {
    let (mut distinct, mut start) = (1, 0);
    let mut crowd = 0..1;
    for k in 1..=heights.len() {
        let apart = k == heights.len() || heights[k] - heights[k - 1] > SAME_PLACE_MM;
        if !apart {
            continue;
        }
        if k - start > crowd.len() {
            crowd = start..k;
        }
        if k < heights.len() {
            distinct += 1;
        }
        start = k;
    }
    if crowd.len() == 1 {
        return Ok(());
    }
    Err(ReadError::SamePosition {
        path: source.to_owned(),
        slices: crowd.len(),
        position_mm: positions[crowd.start].coords.into(),
        total: positions.len(),
        positions: distinct,
    })
}

/// Steps between consecutive slices along a line.
pub(super) enum Steps {
    /// Equal steps.
    Even(Vector3<f64>),
    /// Different steps, with the error that names them.
    Uneven(ReadError),
}

/// Returns the step between slices if every slice is on the lattice spanned by the first and last; refuses slices off the line
/// between these, since no lattice contains them.
pub(super) fn even_step(
    source: &Path,
    positions: &[Point3<f64>],
    heights: &[f64],
) -> Result<Steps, ReadError> {
    let at = |k: usize| positions[k];
    let last = positions.len() - 1;
    let step = (at(last) - at(0)) / last as f64;
    let slack_mm =
        OFF_LATTICE_MM.min(OFF_LATTICE_STEPS * (heights[last] - heights[0]) / last as f64);
    let off_mm = |k: usize| (at(k) - (at(0) + step * k as f64)).norm();
    if (1..last).all(|k| off_mm(k) <= slack_mm) {
        return Ok(Steps::Even(step));
    }
    let (steps, expected_mm) = steps(positions);
    let differs = |found_mm: f64, by_mm: f64| (found_mm - expected_mm).abs() > by_mm;
    let worst_mm = steps
        .iter()
        .map(|s| (s - expected_mm).abs())
        .fold(0.0, f64::max);
    // A slow drift has no single outlying step: in that case the largest deviations are named.
    let by_mm = slack_mm.min(0.999 * worst_mm);
    let gaps = (0..last).filter(|&k| differs(steps[k], by_mm));
    let gaps = gaps.map(|k| Gap {
        after_slice: k,
        found_mm: steps[k],
    });
    let gaps = gaps.collect::<Vec<_>>();
    let line = step.normalize();
    let beside_mm = |k: usize| (at(k) - at(0)).cross(&line).norm();
    let farthest = (1..last).max_by(|&a, &b| beside_mm(a).total_cmp(&beside_mm(b)));
    if let Some(slice) = farthest.filter(|&k| gaps.is_empty() || beside_mm(k) > OFF_LATTICE_MM) {
        return Err(ReadError::Sideways {
            path: source.to_owned(),
            slice,
            off_mm: beside_mm(slice),
        });
    }
    Ok(Steps::Uneven(ReadError::UnevenSteps {
        path: source.to_owned(),
        expected_mm,
        gaps,
    }))
}

/// The distances of neighbours and their lower median, which of a correct and a doubled step is the correct one.
pub(super) fn steps(positions: &[Point3<f64>]) -> (Vec<f64>, f64) {
    let steps = positions.windows(2).map(|pair| (pair[1] - pair[0]).norm());
    let steps = steps.collect::<Vec<_>>();
    let mut sorted = steps.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[(sorted.len() - 1) / 2];
    (steps, usual)
}
