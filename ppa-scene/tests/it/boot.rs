//! A hand-made limb: a shaft with a boot at its end, and its landmarks.

use nalgebra::{Isometry3, Point3};
use ppa_scene::{AxisRegion, AxisSource, Landmarks, LimbKind, Side};

/// Surface points in the `ct` frame (LPS): shaft of radius 40 mm (50 mm at its upper end) from 0 to
/// 250 mm superior of the ankle, sole 70 mm below it, heel 50 mm behind and toes 180 mm in
/// front of the axis; the foot is 25 mm wide to the outside, 45 mm to the inside.
pub fn boot(side: Side) -> Vec<Point3<f32>> {
    let inwards = match side {
        Side::Right => 1.0_f32, // medial of a right leg is the patient's left, +x
        Side::Left => -1.0,
    };
    let mut points = Vec::new();
    for ring in 0..=50 {
        let z = 5.0 * ring as f32;
        let radius = 40.0 + 10.0 * z / 250.0;
        for step in 0..60 {
            let (sin, cos) = (std::f32::consts::TAU * step as f32 / 60.0).sin_cos();
            points.push(Point3::new(inwards * radius * cos, radius * sin, z));
        }
    }
    for x in [-25.0, -10.0, 5.0, 20.0, 45.0] {
        for y in [50.0, 20.0, -40.0, -120.0, -180.0] {
            points.push(Point3::new(inwards * x, y, -70.0));
        }
        points.push(Point3::new(inwards * x, 50.0, -30.0));
        points.push(Point3::new(inwards * x, -180.0, -50.0));
    }
    points
}

/// The tip of the boot's toes, `ct` frame.
pub const TOES_CT: Point3<f64> = Point3::new(0.0, -180.0, -70.0);

pub fn boot_landmarks(side: Side) -> Landmarks {
    let region = |from: f64, to: f64| AxisRegion {
        range_mm: [from, to],
        centre_mm: [0.0, 0.0, 0.5 * (from + to)],
    };
    Landmarks {
        side,
        limb: LimbKind::LowerLeg,
        axis_source: AxisSource::Limb,
        scan_direction: [0.0, 0.0, 1.0],
        joint_region: region(30.0, 70.0),
        calf_region: region(130.0, 200.0),
        axis_point: [0.0, 0.0, 50.0],
        axis_direction: [0.0, 0.0, 1.0],
        anterior: [0.0, -1.0, 0.0],
        joint_centre: [0.0, 0.0, 0.0],
        plane_points: [
            [0.0, 50.0, -70.0],
            [-20.0, 50.0, 250.0],
            [20.0, 50.0, 250.0],
        ],
        notes: Vec::new(),
        joints: Vec::new(),
    }
}

/// The same landmarks after the scan was moved.
pub fn moved(landmarks: &Landmarks, motion: &Isometry3<f64>) -> Landmarks {
    let point = |p: [f64; 3]| (motion * Point3::from(p)).coords.into();
    let direction = |d: [f64; 3]| (motion.rotation * nalgebra::Vector3::from(d)).into();
    Landmarks {
        axis_point: point(landmarks.axis_point),
        joint_centre: point(landmarks.joint_centre),
        plane_points: landmarks.plane_points.map(point),
        axis_direction: direction(landmarks.axis_direction),
        anterior: direction(landmarks.anterior),
        scan_direction: direction(landmarks.scan_direction),
        ..landmarks.clone()
    }
}
