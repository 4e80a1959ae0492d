//! Invalid surfaces, and cameras inside surfaces.

use nalgebra::{Isometry3, Point3, Vector3};
use ppa_depth::{Body, BodyError, MeshBody, PlacedBody, SurfelBody, render};

use crate::cameras::pinhole;
use crate::shapes::bumpy;

/// Recordings contain repeated points and meshes triangles without area; neither may break the index.
#[test]
fn repeated_points_and_flat_triangles_do_no_harm() {
    let points = vec![Point3::new(0.0, 0.0, 500.0); 20_000];
    let cloud = SurfelBody::new(&points, &vec![Vector3::z(); points.len()], 50.0).unwrap();
    let corners =
        [(-50.0, -50.0), (50.0, -50.0), (0.0, 50.0)].map(|(x, y)| Point3::new(x, y, 500.0));
    let flat = [[0, 1, 1], [2, 2, 2], [0, 1, 2], [1, 0, 2]];
    let mesh = MeshBody::new(&corners, &flat).unwrap();
    for body in [Body::from(cloud), Body::from(mesh)] {
        let placed = PlacedBody {
            body: &body,
            camera_from_body: Isometry3::identity(),
        };
        let image = render(&pinhole(11, 11, 500.0), &[placed]);
        assert_eq!((image.min_mm(), image.valid_pixels()), (Some(500.0), 121));
    }
}

#[test]
fn what_is_no_surface_is_refused() {
    let corners = [
        Point3::new(0.0, 0.0, 0.0),
        Point3::new(1.0, 0.0, 0.0),
        Point3::new(0.0, 1.0, f32::NAN),
    ];
    let mesh = |triangles: &[[u32; 3]]| MeshBody::new(&corners, triangles).unwrap_err();
    assert_eq!(mesh(&[]), BodyError::Empty("triangle"));
    assert!(matches!(
        mesh(&[[0, 1, 2]]),
        BodyError::Coordinate { index: 2, .. }
    ));
    let missing = MeshBody::new(&corners[..2], &[[0, 1, 0], [0, 1, 2]]).unwrap_err();
    assert_eq!(
        missing,
        BodyError::Vertex {
            triangle: 1,
            vertex: 2,
            vertices: 2
        }
    );
    let cloud = |normals: &[Vector3<f32>], radius_mm| {
        SurfelBody::new(&corners[..1], normals, radius_mm).unwrap_err()
    };
    assert_eq!(
        cloud(&[], 1.0),
        BodyError::NormalCount {
            points: 1,
            normals: 0
        }
    );
    assert!(matches!(
        cloud(&[Vector3::zeros()], 1.0),
        BodyError::Normal { index: 0, .. }
    ));
    assert!(matches!(
        cloud(&[Vector3::new(f32::NAN, 0.0, 1.0)], 1.0),
        BodyError::Normal { index: 0, .. }
    ));
    assert_eq!(cloud(&[Vector3::z()], 0.0), BodyError::Radius(0.0));
    assert_eq!(cloud(&[Vector3::z()], 1e39), BodyError::Radius(1e39));
}

#[test]
fn a_camera_inside_a_closed_mesh_is_refused() {
    let (vertices, triangles) = bumpy(3);
    let body = Body::from(MeshBody::new(&vertices, &triangles).unwrap());
    let at = |x: f64, y: f64, z: f64| {
        let placed = PlacedBody {
            body: &body,
            camera_from_body: Isometry3::new(Vector3::new(x, y, z), Vector3::new(0.4, 0.0, 0.2)),
        };
        placed.require_camera_outside()
    };
    assert!(matches!(
        at(3.0, -2.0, 5.0),
        Err(BodyError::CameraInside { .. })
    ));
    // No point of it is further than 68 mm from its middle.
    assert!(at(0.0, 0.0, 68.0).is_ok() && at(40.0, 40.0, -40.0).is_ok());
    // Half a sphere has no inside.
    let half: Vec<_> = triangles
        .iter()
        .filter(|t| t.iter().all(|&i| vertices[i as usize].z > -1.0))
        .copied()
        .collect();
    let half = Body::from(MeshBody::new(&vertices, &half).unwrap());
    let placed = PlacedBody {
        body: &half,
        camera_from_body: Isometry3::translation(0.0, 0.0, 20.0),
    };
    assert!(placed.require_camera_outside().is_ok());
}

/// Triangles with invalid numbers are not tested at every pixel, which would take minutes.
#[test]
fn a_pose_that_is_no_pose_shows_nothing_and_is_refused() {
    let (vertices, triangles) = bumpy(7);
    let body = Body::from(MeshBody::new(&vertices, &triangles).unwrap());
    let camera = pinhole(400, 400, 500.0);
    for mm in [f64::NAN, f64::INFINITY, 1e12] {
        let placed = PlacedBody {
            body: &body,
            camera_from_body: Isometry3::translation(0.0, mm, 500.0),
        };
        assert_eq!(render(&camera, &[placed]).valid_pixels(), 0);
        assert!(matches!(
            placed.require_camera_outside(),
            Err(BodyError::Pose(_))
        ));
    }
}

/// A corner at the eye may be anywhere in the image.
#[test]
fn a_corner_at_the_eye_does_no_harm() {
    let corners = [
        (0.0, 0.0, 1e-12),
        (-400.0, -300.0, 1000.0),
        (400.0, -300.0, 1000.0),
    ];
    let corners = corners.map(|(x, y, z)| Point3::new(x, y, z));
    let beyond = [(0.0, 300.0, 900.0)].map(|(x, y, z)| Point3::new(x, y, z));
    let vertices: Vec<_> = corners.into_iter().chain(beyond).collect();
    let body = Body::from(MeshBody::new(&vertices, &[[0, 1, 2], [1, 2, 3]]).unwrap());
    let placed = PlacedBody {
        body: &body,
        camera_from_body: Isometry3::identity(),
    };
    let image = render(&pinhole(101, 101, 50.0), &[placed]);
    assert!(image.z_mm[60 * 101 + 50] > 900.0);
}
