//! Where swellings are plausible on a lower leg.

use nalgebra::{Point3, Vector3};
use ppa_mesh::BumpSite;

use crate::landmarks::{Landmarks, Side};

/// Half the diameter of an ankle, roughly: sites lie this far from the axis, and a site is large
/// enough to reach the skin of thin and of swollen limbs.
const SKIN_MM: f64 = 38.0;
const RADIUS_MM: f64 = 36.0;

/// Sites for the paper's bumps: the medial, lateral and anterior side of the joint, and the shin
/// at both ends of the stretch between the joint region and the calf region, since injuries are
/// frequent there. In the `ct` frame.
pub fn bump_sites(landmarks: &Landmarks) -> Vec<BumpSite> {
    let medial: Vector3<f64> = match landmarks.side {
        Side::Right => -Vector3::x(),
        Side::Left => Vector3::x(),
    };
    let (front, up) = (Vector3::y(), Vector3::z());
    // The flat face of the shin looks forward and inward.
    let shin = (front + 0.6 * medial).normalize() * SKIN_MM;
    let ct_from_patient = landmarks.patient_from_ct().inverse();
    [
        medial * SKIN_MM,
        -medial * SKIN_MM,
        front * SKIN_MM,
        shin + up * landmarks.joint_region.range_mm[1],
        shin + up * landmarks.calf_region.range_mm[0],
    ]
    .map(|offset| BumpSite {
        centre: ct_from_patient * Point3::from(offset),
        radius_mm: RADIUS_MM,
    })
    .into()
}
