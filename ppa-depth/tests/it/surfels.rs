//! Recorded points as discs.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use ppa_depth::{Body, PlacedBody, SurfelBody, render};

use crate::cameras::{pinhole, small_kinect};

/// A square grid of discs of radius g/√2 covers its plane; each pixel then has the depth of the plane.
#[test]
fn a_recorded_plane_is_covered_and_flat() {
    let points: Vec<_> = (0..250_000)
        .map(|i| Point3::new((i % 500 * 4) as f32, (i / 500 * 4) as f32, 0.0))
        .collect();
    let normals = vec![Vector3::new(0.0, 0.0, -3.0); points.len()];
    let body =
        Body::from(SurfelBody::new(&points, &normals, 4.0 / 2.0_f64.sqrt() * 1.0001).unwrap());
    let camera = small_kinect();
    let centre = Isometry3::translation(-1000.0, -1000.0, 0.0);
    let camera_from_body =
        Isometry3::new(Vector3::new(0.0, 0.0, 700.0), Vector3::new(0.4, 0.3, 0.1)) * centre;
    let image = render(
        &camera,
        &[PlacedBody {
            body: &body,
            camera_from_body,
        }],
    );
    let (normal, on_plane) = (
        camera_from_body * Vector3::z(),
        camera_from_body * Point3::origin(),
    );
    let body_from_camera = camera_from_body.inverse();
    let mut on_patch = 0;
    for (ray, &z_mm) in camera.rays().iter().zip(&image.z_mm) {
        let direction = Vector3::new(ray.unwrap().x, ray.unwrap().y, 1.0);
        let exact_mm = normal.dot(&on_plane.coords) / normal.dot(&direction);
        let meets = body_from_camera * Point3::from(direction * exact_mm);
        if exact_mm > 0.0
            && [meets.x, meets.y]
                .iter()
                .all(|at| (0.0..1996.0).contains(at))
        {
            assert!(
                (f64::from(z_mm) - exact_mm).abs() < 1e-3,
                "{z_mm} instead of {exact_mm}"
            );
            on_patch += 1;
        }
    }
    assert!(on_patch > 20_000, "{on_patch} pixels");
}

#[test]
fn a_disc_covers_exactly_the_pixels_within_its_radius() {
    // Oblique in its own frame, rotated to face the camera.
    let normal = Vector3::new(1.0, -2.0, 3.0);
    let body = Body::from(SurfelBody::new(&[Point3::origin()], &[normal], 31.7).unwrap());
    let facing = UnitQuaternion::rotation_between(&normal.cast(), &Vector3::z()).unwrap();
    let camera = pinhole(101, 101, 500.0);
    let camera_from_body = Isometry3::from_parts(Translation3::new(0.0, 0.0, 400.0), facing);
    let image = render(
        &camera,
        &[PlacedBody {
            body: &body,
            camera_from_body,
        }],
    );
    let radius_px = 31.7 * 500.0 / 400.0;
    for (i, &z_mm) in image.z_mm.iter().enumerate() {
        let (du, dv) = ((i % 101) as f64 - 50.0, (i / 101) as f64 - 50.0);
        assert_eq!(z_mm > 0.0, du.hypot(dv) <= radius_px, "{du} {dv}");
    }
}
