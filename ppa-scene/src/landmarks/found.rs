//! Landmarks needed to pose a limb, and the frame they define.

use nalgebra::{Matrix3, Point3, Unit, Vector3};
use ppa_core::Side;
use serde::{Deserialize, Serialize};

use crate::frames::{Ct, Patient, Rigid};
use crate::landmarks::limb_kind::{Joint, LimbKind};
use crate::landmarks::notes::LandmarkNote;
use crate::room::plane::Plane;

/// A joint that the limb shows, whether or not the limb is posed about it; `ct` frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FoundJoint {
    /// The joint.
    pub joint: Joint,
    /// Position, mm: the point of the tibia's shaft in the gap of an ankle, the middle of the plateau in that of a knee.
    pub centre_mm: [f64; 3],
    /// Depth of the joint space: difference to the less dense of the adjacent bone plates, HU.
    pub gap_depth_hu: f64,
    /// Further findings for a knee.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lines: Option<KneeLines>,
}

/// Directions of a knee and how far the scan shows it; `ct` frame, unit vectors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KneeLines {
    /// Line through the middle of both compartments' joint spaces, seen from the front, towards the patient's right.
    pub joint_line: [f64; 3],
    /// Anterior direction, perpendicular to the posterior condylar line; `None` when the scan cuts the back of a condyle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub anterior: Option<[f64; 3]>,
    /// Whether the scan cuts the tibial plateau: the joint centre is less certain then.
    pub plateau_is_cut: bool,
}

/// Whose cross-sections give the longitudinal axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AxisSource {
    /// The tibia, or a knee's femur: swelling and calf muscle do not move the axis off the joint.
    Bone,
    /// The whole cross-section inside the skin.
    Limb,
    /// Two points given by the user.
    Given,
}

/// A stretch of the limb and the centre of its cross-sections.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AxisRegion {
    /// First and last distance proximal to the joint level along the scan's limb direction, mm; below 0, distal to it.
    pub range_mm: [f64; 2],
    /// Mean of the cross-section centres, or the given point of the axis, `ct` frame, mm.
    pub centre_mm: [f64; 3],
}

/// Choices made for one limb; all in the `ct` frame, mm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Landmarks {
    /// Side of the limb.
    pub side: Side,
    /// Kind of limb.
    pub limb: LimbKind,
    /// Source of the two region centres.
    pub axis_source: AxisSource,
    /// Unit normal of the slices, towards proximal: of the scan's own, or, where the shaft is inclined by more than 3 degrees, of slices
    /// across the shaft; region ranges run along it.
    pub scan_direction: [f64; 3],
    /// The region next to the joint: proximal of an ankle, on either side of a knee.
    pub joint_region: AxisRegion,
    /// The region farther away: around the calf, or in the thigh.
    pub calf_region: AxisRegion,
    /// A point of the rotation axis.
    pub axis_point: [f64; 3],
    /// Unit direction of the rotation axis, towards proximal.
    pub axis_direction: [f64; 3],
    /// Direction that faces up at angle 0; only its component perpendicular to the axis counts.
    pub anterior: [f64; 3],
    /// The point of the axis at the level of the joint: origin of the patient frame.
    pub joint_centre: [f64; 3],
    /// One distal and two proximal points of the plane Π_P under the limb.
    pub plane_points: [[f64; 3]; 3],
    /// What was decided and why; files contain it as findings of the limb.
    #[serde(skip)]
    pub notes: Vec<LandmarkNote>,
    /// The joints found, from distal to proximal; not searched for in a limb given as `other`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joints: Vec<FoundJoint>,
}

impl Landmarks {
    /// T^P_CT: the patient frame has z along the axis, y anterior, x to the patient's right and
    /// its origin at the joint centre.
    pub fn patient_from_ct(&self) -> Rigid<Patient, Ct> {
        let z = Vector3::from(self.axis_direction).normalize();
        let anterior = Vector3::from(self.anterior);
        let y = (anterior - z * z.dot(&anterior)).normalize();
        let axes = Matrix3::from_columns(&[y.cross(&z), y, z]);
        let ct_from_patient =
            Rigid::<Ct, Patient>::from_axes(axes, Point3::from(self.joint_centre));
        ct_from_patient.inverse()
    }

    /// [`Self::plane_patient`], or what the three points should be: not on one line (within 1 mm in
    /// 1 m), and their plane along the limb.
    pub(crate) fn supporting_plane(&self) -> Result<Plane, &'static str> {
        let [a, b, c] = self.plane_points.map(Vector3::from);
        let [u, v] = [b - a, c - a];
        let sine = u.cross(&v).norm() / (u.norm() * v.norm());
        if sine.is_nan() || sine < 1e-3 {
            return Err("three points that are not on one line");
        }
        let plane = self.plane_patient();
        // The normal is within 64 degrees of perpendicular to the limb's axis.
        (plane.normal.z.abs() <= 0.9)
            .then_some(plane)
            .ok_or("three points of a plane along the limb")
    }

    /// Π_P in the patient frame; its normal points to the limb (anterior).
    pub fn plane_patient(&self) -> Plane {
        let patient_from_ct = self.patient_from_ct();
        let [a, b, c] = self.plane_points.map(|p| patient_from_ct * Point3::from(p));
        let mut normal = Unit::new_normalize((b - a).cross(&(c - a)));
        if normal.y < 0.0 {
            normal = -normal;
        }
        Plane::through(&a, normal)
    }
}
