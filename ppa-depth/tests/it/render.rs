//! Depth images of meshes whose depth is known, or is found by ray casting.

use nalgebra::{Isometry3, Point3, Vector3};
use parry3d::glamx::Vec3;
use parry3d::query::{Ray, RayCast};
use parry3d::shape::TriMesh;
use ppa_depth::{
    Body, Camera, CameraSpec, DepthImage, DepthMode, MeshBody, PlacedBody, SurfelBody, render,
};

use crate::cameras::small_kinect;
use crate::shapes::{bumpy, sphere};

/// Depth at which a ray (x, y, 1) t first meets a sphere.
fn sphere_depth(x: f64, y: f64, centre: &Vector3<f64>, radius: f64) -> Option<f64> {
    let ray = Vector3::new(x, y, 1.0);
    let (a, b, c) = (
        ray.norm_squared(),
        ray.dot(centre),
        centre.norm_squared() - radius * radius,
    );
    let discriminant = b * b - a * c;
    (discriminant >= 0.0).then(|| (b - discriminant.sqrt()) / a)
}

/// The facets lie between the sphere and one of the facets' smallest distance, so the depth lies between the depths of
/// those two: exact at every pixel, also at grazing ones. The mesh is rotated so that body and camera frames differ.
#[test]
fn a_sphere_has_its_analytic_depth_through_the_distortion() {
    let (vertices, triangles, inner_mm) = sphere(180.0, 6);
    let body = Body::from(MeshBody::new(&vertices, &triangles).unwrap());
    let centre = Vector3::new(60.0, -40.0, 1100.0);
    let camera_from_body = Isometry3::new(centre, Vector3::new(0.4, -1.0, 2.0));
    let camera = small_kinect();
    let image = render(
        &camera,
        &[PlacedBody {
            body: &body,
            camera_from_body,
        }],
    );
    let rounding_mm = 2e-4; // f32: vertices at 180 mm, depths at 1 m
    let mut hits = 0;
    for (ray, &z_mm) in camera.rays().iter().zip(&image.z_mm) {
        let ray = ray.expect("the narrow mode lies within the metric radius");
        let near = sphere_depth(ray.x, ray.y, &centre, 180.0 + rounding_mm);
        let far = sphere_depth(ray.x, ray.y, &centre, inner_mm - rounding_mm);
        match (near, far) {
            (Some(near), Some(far)) => {
                let z = f64::from(z_mm);
                assert!(
                    near - rounding_mm <= z && z <= far + rounding_mm,
                    "{near} {z} {far}"
                );
                hits += 1;
            }
            (None, _) => assert_eq!(z_mm, 0.0),
            (Some(_), None) => {} // the rim, within the tessellation error
        }
    }
    assert!(hits > 1200, "{hits} pixels on the sphere");
    assert!(180.0 - inner_mm < 0.02);
}

#[test]
fn what_is_nearer_hides_what_is_behind_in_any_order() {
    let (vertices, triangles, _) = sphere(100.0, 4);
    let ball = Body::from(MeshBody::new(&vertices, &triangles).unwrap());
    let wall_points: Vec<_> = (0..10_000)
        .map(|i| Point3::new((i % 100 * 10) as f32, (i / 100 * 10) as f32, 0.0))
        .collect();
    let wall = Body::from(SurfelBody::new(&wall_points, &[Vector3::z(); 10_000], 7.2).unwrap());
    let camera = small_kinect();
    let ball = PlacedBody {
        body: &ball,
        camera_from_body: Isometry3::translation(20.0, 0.0, 900.0),
    };
    let wall = PlacedBody {
        body: &wall,
        camera_from_body: Isometry3::translation(-495.0, -495.0, 850.0),
    };
    let both = render(&camera, &[wall, ball]);
    assert_eq!(both, render(&camera, &[ball, wall]));
    let (only_ball, only_wall) = (render(&camera, &[ball]), render(&camera, &[wall]));
    assert_eq!(both, DepthImage::nearer_of(&only_ball, &only_wall).unwrap());
    // The ball sticks out of the wall: its rim is behind the wall, its front before it.
    assert!(
        both.z_mm
            .iter()
            .zip(&only_wall.z_mm)
            .any(|(both, wall)| both < wall)
    );
    assert!(
        both.z_mm
            .iter()
            .zip(&only_ball.z_mm)
            .any(|(both, ball)| *ball > 0.0 && both < ball)
    );
    // A body behind the camera is not seen.
    let behind = PlacedBody {
        camera_from_body: Isometry3::translation(0.0, 0.0, -900.0),
        ..ball
    };
    assert!(render(&camera, &[behind]).require_visible().is_err());
}

/// Vertices, triangles and pose.
type Placed<'a> = (&'a [Point3<f32>], &'a [[u32; 3]], Isometry3<f64>);

/// parry3d's own triangle mesh and ray test, in single precision, on the same scene: bumpy bodies before a tilted wall whose
/// triangles reach far outside the image, through the distortion of a wide camera.
#[test]
fn the_image_is_that_of_ray_casting_by_parry() {
    let camera = {
        let mut spec = CameraSpec::azure_kinect(DepthMode::WfovBinned);
        spec.metric_radius = Some(1.2);
        Camera::try_from(spec).unwrap()
    };
    let (ball, ball_triangles) = bumpy(6);
    // Facets of some 50 pixels, whose edges bow by several.
    let (coarse, coarse_triangles) = bumpy(1);
    let wall = [(-9e3, -7e3), (8e3, -9e3), (7e3, 9e3), (-8e3, 8e3)]
        .map(|(x, y)| Point3::new(x, y, 1500.0 + 0.1 * x - 0.05 * y));
    let scene: [Placed; 3] = [
        (&wall, &[[0, 1, 2], [0, 2, 3]], Isometry3::identity()),
        (
            &ball,
            &ball_triangles,
            Isometry3::new(
                Vector3::new(-40.0, 10.0, 300.0),
                Vector3::new(0.3, 0.2, -1.0),
            ),
        ),
        (
            &coarse,
            &coarse_triangles,
            Isometry3::new(
                Vector3::new(120.0, 80.0, 120.0),
                Vector3::new(2.0, -0.2, 1.0),
            ),
        ),
    ];
    let bodies: Vec<Body> = scene
        .iter()
        .map(|(vertices, triangles, _)| MeshBody::new(vertices, triangles).unwrap().into())
        .collect();
    let placed: Vec<_> = bodies
        .iter()
        .zip(&scene)
        .map(|(body, &(_, _, camera_from_body))| PlacedBody {
            body,
            camera_from_body,
        })
        .collect();
    let image = render(&camera, &placed);

    let meshes = scene.map(|(vertices, triangles, camera_from_body)| {
        let corners = vertices.iter().map(|vertex| {
            let corner = (camera_from_body * vertex.cast::<f64>()).cast::<f32>();
            Vec3::new(corner.x, corner.y, corner.z)
        });
        TriMesh::new(corners.collect(), triangles.to_vec()).unwrap()
    });
    let cast = |slopes: &nalgebra::Vector2<f64>| {
        let ray = Ray::new(Vec3::ZERO, Vec3::new(slopes.x as f32, slopes.y as f32, 1.0));
        let hits = meshes
            .iter()
            .filter_map(|mesh| mesh.cast_local_ray(&ray, 1e6, false));
        hits.reduce(f32::min)
    };
    let (mut hits, mut jumps, mut worst_mm) = (0, 0, 0.0_f32);
    for (ray, &z_mm) in camera.rays().iter().zip(&image.z_mm) {
        let expected = ray.as_ref().and_then(cast).unwrap_or(0.0);
        assert_eq!(
            z_mm > 0.0,
            expected > 0.0,
            "{ray:?}: {z_mm} and {expected} mm"
        );
        hits += usize::from(z_mm > 0.0);
        // At the rim of a body single precision may see past it.
        if (z_mm - expected).abs() > 1.0 {
            jumps += 1;
        } else {
            worst_mm = worst_mm.max((z_mm - expected).abs());
        }
    }
    println!("{hits} hits, {jumps} on the other side of a rim, else within {worst_mm} mm");
    assert!(hits > 140_000 && jumps == 0 && worst_mm < 0.002);
}
