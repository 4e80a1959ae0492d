//! Finding the landmarks of a limb in its scan.

use nalgebra::{Point3, Vector3};
use ppa_core::Side;
use ppa_ct::Volume;
use ppa_mesh::Mesh;

use crate::landmarks::axis_regions::Reference;
use crate::landmarks::choices::{LandmarkError, LandmarkOverrides};
use crate::landmarks::found::{AxisSource, Landmarks};
use crate::landmarks::given_choices::{check_anterior, check_joint};
use crate::landmarks::knee::Knee;
use crate::landmarks::knee_axis::KneeAxis;
use crate::landmarks::limb_kind::LimbKind;
use crate::landmarks::notes::LandmarkNote;
use crate::landmarks::supporting_plane::{check_plane, plane_under};
use crate::room::plane::first_not_finite;

/// Finds joint level, rotation axis and supporting plane of a limb.
///
/// `limb` is the skin in the `ct` frame, `mask` one value per voxel of `volume`: whether it
/// belongs to the limb. Scans are patient scans (LPS), so proximal is superior; a limb is reversed
/// only if a leg shows its joint the other way round.
///
/// * Kind: a lower leg if an ankle is found, otherwise a knee if one is; every joint found is in
///   [`Landmarks::joints`]. Another limb only on request, or about a given joint centre.
/// * Slices: the scan's own; if the shaft is inclined in them by more than 3 degrees, interpolated ones
///   across it.
/// * Joint level of a lower leg: the gap between plafond and talar dome in a column along the
///   tibia's shaft. Of a knee: the gap between condyles and plateau, half-way between its two
///   compartments. Other limbs: the middle of the limb.
/// * Axis of a lower leg: through the centres of two regions, 50 to 90 mm and 130 to 200 mm proximal of the joint
///   level, closer together when the scan is short; of other limbs around a quarter and three
///   quarters of the length. The centres are those of the tibia, because the paper wants the axis
///   to pass through the joint and a swelling moves the centre of the skin; without bone, or on
///   request, they are those of the limb's cross-sections. Two given points replace them.
/// * Axis of a knee: through the centre of the tibial plateau, along the tibia's shaft, 65 to 95 mm and
///   110 to 150 mm distal of the joint. For an AP radiograph of the knee the leg is rotated about its
///   long axis from hip to ankle, along which the tibia runs; the femur's shaft, which is inclined to it
///   by about 6 degrees, replaces it if less than 100 mm of tibia are visible, and both are used together if too
///   little of either is.
/// * Anterior: −y of the scan across the axis, so that angle 0 is the pose in the scan. Of a knee: perpendicular to the
///   posterior condylar line, so that at angle 0 both condyles are equally far from the table; ±y of the scan
///   where the scan cuts a condyle.
/// * Π_P: the plane that touches the limb from behind at its lowest distal and proximal points
///   and is level from left to right. Its three points are the distal contact and two points 20 mm
///   left and right of the proximal contact, so that no part of the limb lies behind the plane.
///
/// # Errors
/// [`LandmarkError`] when a choice cannot be made or an override is unusable.
pub fn find_landmarks(
    volume: &Volume,
    limb: &Mesh,
    mask: &[bool],
    side: Side,
    overrides: &LandmarkOverrides,
) -> Result<Landmarks, LandmarkError> {
    if mask.len() != volume.grid().len() {
        return Err(LandmarkError::MaskLength {
            found: mask.len(),
            expected: volume.grid().len(),
        });
    }
    let voxels = mask.iter().filter(|inside| **inside).count();
    if voxels == 0 || limb.vertices.is_empty() {
        return Err(LandmarkError::Empty {
            voxels,
            vertices: limb.vertices.len(),
        });
    }
    if let Some(vertex) = first_not_finite(&limb.vertices) {
        return Err(LandmarkError::NotFinite { vertex });
    }
    overrides.check()?;
    if let Some(joint) = overrides.joint_centre {
        // Before the regions, which would not be found around it.
        check_joint(&joint.into(), volume, mask)?;
    }
    let mut notes = Vec::new();
    let reference = Reference::find(volume, mask, overrides, &mut notes)?;
    let (joint_region, calf_region, axis_source) = match overrides.axis {
        Some(points) => {
            let (low, high) = reference.given_axis(points)?;
            (low, high, AxisSource::Given)
        }
        None => reference.regions(overrides)?,
    };
    let mut regions = [joint_region, calf_region];
    regions.sort_by(|a, b| a.range_mm[0].total_cmp(&b.range_mm[0]));
    let [low, high] = regions.map(|region| Point3::from(region.centre_mm));
    if reference.kind == LimbKind::Knee && overrides.axis.is_none() {
        let axis = KneeAxis::of([joint_region, calf_region].map(|region| region.range_mm));
        if axis != KneeAxis::Tibia {
            notes.push(LandmarkNote::KneeAxis(axis));
        }
    }
    let direction = reference.sections.direction;
    let axis = (high - low)
        .try_normalize(1e-3)
        .filter(|axis| axis.dot(&direction) >= std::f64::consts::FRAC_1_SQRT_2)
        .ok_or(LandmarkError::Region {
            name: "calf region",
            from_mm: calf_region.range_mm[0],
            to_mm: calf_region.range_mm[1],
            problem: "has the same centre as the joint region, or one that gives an axis more \
                      than 45 degrees off the scan's limb direction",
        })?;
    let centre = overrides.joint_centre.map(Point3::from);
    let centre = centre.or(reference.knee.map(|knee| knee.centre));
    let (axis_point, joint_centre) = match (centre, overrides.axis) {
        (Some(centre), None) => (centre, centre),
        (Some(centre), Some(_)) => {
            let foot = low + axis * axis.dot(&(centre - low));
            notes.push(LandmarkNote::JointMovedToAxis {
                aside_mm: (centre - foot).norm(),
            });
            (low, foot)
        }
        (None, _) => {
            let rise = reference.level_mm - direction.dot(&low.coords);
            (low, low + axis * (rise / axis.dot(&direction)))
        }
    };
    notes.extend(check_joint(&joint_centre, volume, mask)?);
    let anterior = match (overrides.anterior, reference.knee) {
        (Some(given), _) => Vector3::from(given),
        (None, Some(knee)) => front_of(&knee, &mut notes),
        (None, None) => -Vector3::y(),
    };
    notes.extend(check_anterior(&anterior, &axis, overrides)?);
    let across = anterior - axis * axis.dot(&anterior);
    let mut landmarks = Landmarks {
        side,
        limb: reference.kind,
        axis_source,
        scan_direction: direction.into(),
        joint_region,
        calf_region,
        axis_point: axis_point.coords.into(),
        axis_direction: axis.into(),
        anterior: across.normalize().into(),
        joint_centre: joint_centre.coords.into(),
        plane_points: [[0.0; 3]; 3],
        notes,
        joints: reference.joints,
    };
    match overrides.plane_points {
        Some(points) => {
            landmarks.plane_points = points;
            check_plane(limb, &mut landmarks)?;
        }
        None => landmarks.plane_points = plane_under(limb, &landmarks)?,
    }
    Ok(landmarks)
}

/// The front of a knee: perpendicular to the posterior condylar line, or that of the scan if the line is not visible.
fn front_of(knee: &Knee, notes: &mut Vec<LandmarkNote>) -> Vector3<f64> {
    if knee.by_condyles {
        return knee.anterior;
    }
    notes.push(LandmarkNote::CondylesNotSeen);
    Vector3::y() * knee.anterior.y.signum()
}
