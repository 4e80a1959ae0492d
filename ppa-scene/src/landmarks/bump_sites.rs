//! Where swellings are plausible on a lower leg or a knee.

use nalgebra::{Point3, Vector3};
use ppa_core::Side;
use ppa_mesh::BumpSite;

use crate::landmarks::found::Landmarks;
use crate::landmarks::limb_kind::LimbKind;

/// Half the diameter of an ankle, roughly: sites lie this far from the axis, and a site is large
/// enough to reach the skin of thin and of swollen limbs.
const SKIN_MM: f64 = 38.0;
const RADIUS_MM: f64 = 36.0;

/// Half the diameter of a knee, and of a thigh above it.
const KNEE_SKIN_MM: f64 = 54.0;

/// Sites for the paper's bumps: the medial, lateral and anterior side of the joint, and the shin
/// at both ends of the stretch between the joint region and the calf region, since injuries are
/// frequent there; the front of the thigh where those regions lie in it. In the `ct` frame.
pub fn bump_sites(landmarks: &Landmarks) -> Vec<BumpSite> {
    let medial: Vector3<f64> = match landmarks.side {
        Side::Right => -Vector3::x(),
        Side::Left => Vector3::x(),
    };
    let (front, up) = (Vector3::y(), Vector3::z());
    let joint_mm = match landmarks.limb {
        LimbKind::Knee => KNEE_SKIN_MM,
        LimbKind::LowerLeg | LimbKind::Other => SKIN_MM,
    };
    let [joint, calf] = [&landmarks.joint_region, &landmarks.calf_region].map(|r| r.range_mm);
    let ends = if calf[0] >= joint[1] {
        [joint[1], calf[0]]
    } else {
        [joint[0], calf[1]]
    };
    let on_shaft = |along: f64| {
        let in_thigh = landmarks.limb == LimbKind::Knee && along > 0.0;
        // The flat face of the shin looks forward and inward.
        let towards = if in_thigh {
            front
        } else {
            front + 0.6 * medial
        };
        let skin_mm = if in_thigh { KNEE_SKIN_MM } else { SKIN_MM };
        towards.normalize() * skin_mm + up * along
    };
    let ct_from_patient = landmarks.patient_from_ct().inverse();
    [
        medial * joint_mm,
        -medial * joint_mm,
        front * joint_mm,
        on_shaft(ends[0]),
        on_shaft(ends[1]),
    ]
    .map(|offset| BumpSite {
        centre: ct_from_patient * Point3::from(offset),
        radius_mm: RADIUS_MM,
    })
    .into()
}
