//! Origin of the rays of a radiograph.

use nalgebra::{Isometry3, Point3, Unit, UnitQuaternion, Vector3};

/// The focal spot, and the plane through the joint in which lengths are measured; `ct` frame, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exposure {
    pub(super) source: Point3<f64>,
    pub(super) joint: Point3<f64>,
    /// Along the rows of the detector.
    pub(super) across: Vector3<f64>,
    /// Along its columns.
    pub(super) along: Vector3<f64>,
}

impl Exposure {
    /// The exposure of an x-ray device: source at its origin, z along the beam, x and y those of the detector.
    pub fn of_device(ct_from_device: &Isometry3<f64>, joint: Point3<f64>) -> Self {
        Self {
            source: ct_from_device * Point3::origin(),
            joint,
            across: ct_from_device * Vector3::x(),
            along: ct_from_device * Vector3::y(),
        }
    }

    /// The exposure whose central beam passes through the joint perpendicular to the limb's axis, rotated about that axis; `distance_mm`
    /// from source to joint.
    pub(super) fn around(limb: &LimbAxes, angle_rad: f64, distance_mm: f64) -> Self {
        let turn = UnitQuaternion::from_axis_angle(&limb.axis, angle_rad);
        let towards_source = turn * limb.anterior.into_inner();
        Self {
            source: limb.joint + towards_source * distance_mm,
            joint: limb.joint,
            across: limb.axis.cross(&towards_source),
            along: limb.axis.into_inner(),
        }
    }

    /// Intersection of the ray through a point with the plane through the joint: along rows and columns, mm from the joint.
    pub(super) fn projected(&self, point: &Point3<f64>) -> [f64; 2] {
        let normal = self.across.cross(&self.along);
        let ray = point - self.source;
        let scale = (self.joint - self.source).dot(&normal) / ray.dot(&normal);
        let offset = self.source + ray * scale - self.joint;
        [offset.dot(&self.across), offset.dot(&self.along)]
    }

    /// Direction of the ray to a point.
    pub(super) fn ray_to(&self, point: &Point3<f64>) -> Vector3<f64> {
        (point - self.source).normalize()
    }

    pub(super) fn distance_mm(&self) -> f64 {
        (self.joint - self.source).norm()
    }
}

/// A limb at its joint: axis towards proximal, and the direction that faces the tube when the limb is not rotated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LimbAxes {
    pub joint: Point3<f64>,
    pub axis: Unit<Vector3<f64>>,
    pub anterior: Unit<Vector3<f64>>,
}

impl LimbAxes {
    /// The axes of the patient frame: joint at the origin, z towards proximal, y anterior.
    pub fn of_patient(ct_from_patient: &Isometry3<f64>) -> Self {
        Self {
            joint: ct_from_patient * Point3::origin(),
            axis: ct_from_patient * Vector3::z_axis(),
            anterior: ct_from_patient * Vector3::y_axis(),
        }
    }
}
