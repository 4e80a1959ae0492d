//! Surfaces that the camera sees nearly edge-on.

use nalgebra::{Point3, Vector3};
use ppa_depth::{Body, Camera, Invalidation, MeshBody, SensorSpec};

use crate::sensor::{NONE, pinhole, sensor, view};

/// From pixel to pixel these walls recede by far more than the depths at which a step begins. Their angles of incidence spread by
/// 2.3 degrees to either side, so that a limit in the middle parts the image, as does a limit of the signal.
#[test]
fn steep_walls_are_as_oblique_and_as_dim_as_they_are() {
    let camera = Camera::try_from(pinhole(41, 500.0)).unwrap();
    for tilt_deg in [60.0_f64, 80.0, 86.0] {
        let (sin, cos) = tilt_deg.to_radians().sin_cos();
        let corners = [(-900.0, -9e3), (3e3, -9e3), (3e3, 9e3), (-900.0, 9e3)]
            .map(|(t, y): (f64, f64)| Point3::new(t * cos, y, 1000.0 + t * sin).cast::<f32>());
        let wall = Body::from(MeshBody::new(&corners, &[[0, 1, 2], [0, 2, 3]]).unwrap());
        let seen = view(&camera, &[], &wall);
        let lost = |min_signal: f64, max_angle_deg: f64| {
            let invalid = Invalidation {
                min_signal,
                max_angle_deg,
                min_contrast: 0.0,
            };
            let spec = SensorSpec {
                invalid: Some(invalid),
                ..NONE
            };
            sensor(spec).observe(&camera, &seen, 1, 0).unwrap().z_mm
        };
        // The signal in the middle of the image.
        let limit = cos;
        let (dim, oblique) = (lost(limit, 90.0), lost(0.0, tilt_deg));
        for (pixel, ray) in camera.rays().iter().enumerate() {
            let ray = ray.unwrap();
            let direction = Vector3::new(ray.x, ray.y, 1.0);
            let incidence = Vector3::new(sin, 0.0, -cos).dot(&direction).abs() / direction.norm();
            let range_m = f64::from(seen.image.z_mm[pixel]) * direction.norm() / 1000.0;
            let angle_deg = incidence.acos().to_degrees();
            let signal = incidence / (range_m * range_m);
            if (angle_deg - tilt_deg).abs() > 0.1 {
                assert_eq!(
                    oblique[pixel] == 0.0,
                    angle_deg > tilt_deg,
                    "{tilt_deg} {pixel} {angle_deg}"
                );
            }
            if (signal / limit - 1.0).abs() > 0.02 {
                assert_eq!(
                    dim[pixel] == 0.0,
                    signal < limit,
                    "{tilt_deg} {pixel} {signal}"
                );
            }
        }
    }
}
