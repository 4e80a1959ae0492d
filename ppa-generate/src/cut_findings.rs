//! Findings about faces where the field of view of a scan cuts the limb.

use nalgebra::{Point3, Vector3};
use ppa_mesh::{CutWalls, Mesh};
use ppa_scene::{Landmarks, LimbKind};

use ppa_dataset::findings::{Finding, FindingCode, Severity};

/// A wall is an end of the limb if its normal is within 45 degrees of the axis.
const LEAST_COS: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Returns a caution for each face of the scan that cuts the limb, except where a limb extends beyond any scan: at the proximal end, and at
/// the distal end of all but lower legs with their foot.
pub(crate) fn cuts(walls: &CutWalls, skin: &Mesh, landmarks: &Landmarks) -> Vec<Finding> {
    let joint = Point3::from(landmarks.joint_centre);
    let axis = Vector3::from(landmarks.axis_direction).normalize();
    let measured = walls.measured(skin).into_iter();
    let doubtful = measured.filter(|wall| {
        let along = wall.outward.dot(&axis);
        let goes_on =
            along > LEAST_COS || along < -LEAST_COS && landmarks.limb != LimbKind::LowerLeg;
        !goes_on
    });
    let finding = |wall: ppa_mesh::WallMeasure| {
        let [x, y, z]: [f64; 3] = wall.centre.into();
        Finding {
            code: FindingCode::CutLimb,
            severity: Severity::Caution,
            text: format!(
                "the field of view cuts the limb at its face {}: {:.0} mm² around {x:.0}, {y:.0}, {z:.0} mm, {:.0} mm from \
                 the joint; what is missing there is also missing in depth images and radiographs",
                wall.face,
                wall.area_mm2,
                (wall.centre - joint).norm()
            ),
            value: Some(wall.area_mm2),
            place_mm: Some(wall.centre.into()),
        }
    };
    doubtful.map(finding).collect()
}
