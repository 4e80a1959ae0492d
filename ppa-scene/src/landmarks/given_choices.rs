//! Checks of a given joint centre and anterior direction against the limb.

use nalgebra::{Point3, Vector3};
use ppa_ct::Volume;

use crate::landmarks::choices::{LandmarkError, LandmarkOverrides};
use crate::landmarks::notes::LandmarkNote;

/// Largest distance of a joint from the part of the limb in the scan, mm: about half the thickness of
/// a knee, one side of which the field of view can cut away.
const JOINT_MOST_MM: f64 = 60.0;

/// An anterior direction closer to the axis than this is considered a mistake, degrees: its component across the
/// axis would be less than half of it.
const ANTERIOR_LEAST_DEG: f64 = 30.0;

/// Refuses a joint centre far from the limb, and notes one outside of it.
pub(crate) fn check_joint(
    joint: &Point3<f64>,
    volume: &Volume,
    mask: &[bool],
) -> Result<Option<LandmarkNote>, LandmarkError> {
    let grid = volume.grid();
    let (mut low, mut high) = (
        Vector3::repeat(f64::INFINITY),
        Vector3::repeat(f64::NEG_INFINITY),
    );
    let mut nearest_sq = f64::INFINITY;
    for index in (0..mask.len()).filter(|index| mask[*index]) {
        let centre = grid.centre(grid.voxel(index).map(|v| v as f64));
        nearest_sq = nearest_sq.min((centre - joint).norm_squared());
        (low, high) = (low.inf(&centre.coords), high.sup(&centre.coords));
    }
    // A point of a voxel is up to half its diagonal away from its centre.
    let distance_mm = (nearest_sq.sqrt() - 0.5 * grid.spacing_mm().norm()).max(0.0);
    if distance_mm > JOINT_MOST_MM {
        return Err(LandmarkError::JointFar {
            found: joint.coords.into(),
            distance_mm,
            most_mm: JOINT_MOST_MM,
            low: low.into(),
            high: high.into(),
        });
    }
    Ok((distance_mm > 0.0).then_some(LandmarkNote::JointOutside { distance_mm }))
}

/// Refuses an anterior direction along the axis, and notes one that points to the patient's back.
///
/// The scan's own direction is only refused if its component across the axis is too small to use.
pub(crate) fn check_anterior(
    anterior: &Vector3<f64>,
    axis: &Vector3<f64>,
    overrides: &LandmarkOverrides,
) -> Result<Option<LandmarkNote>, LandmarkError> {
    const SCAN_LEAST_DEG: f64 = 6.0;
    let least_deg = match overrides.anterior {
        Some(_) => ANTERIOR_LEAST_DEG,
        None => SCAN_LEAST_DEG,
    };
    let angle_deg = anterior
        .cross(axis)
        .norm()
        .atan2(anterior.dot(axis).abs())
        .to_degrees();
    if angle_deg < least_deg {
        return Err(LandmarkError::AnteriorAlongAxis {
            found: (*anterior).into(),
            angle_deg,
            least_deg,
        });
    }
    // −y of the patient (LPS) is anterior however the patient lies.
    let across = anterior - axis * axis.dot(anterior);
    let angle_deg = across.angle(&-Vector3::y()).to_degrees();
    Ok((angle_deg > 90.0).then_some(LandmarkNote::AnteriorReversed { angle_deg }))
}
