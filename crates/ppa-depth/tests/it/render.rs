//! Depth images of shapes whose depth is known.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use parry3d::glamx::Vec3;
use parry3d::query::{Ray, RayCast};
use parry3d::shape::TriMesh;
use ppa_depth::{
    Body, BodyError, Camera, CameraModel, CameraSpec, DepthImage, DepthMode, MeshBody, PlacedBody,
    SurfelBody, render,
};

use crate::shapes::{bumpy, sphere};

/// The default camera at a quarter of its resolution, which is enough for a test.
fn small_kinect() -> Camera {
    let full = CameraSpec::azure_kinect(DepthMode::NfovUnbinned);
    let quarter = |pixels: f64| (pixels + 0.5) / 4.0 - 0.5;
    let (cx, cy) = (quarter(full.cx), quarter(full.cy));
    let spec = CameraSpec {
        width: 160,
        height: 144,
        fx: full.fx / 4.0,
        fy: full.fy / 4.0,
        cx,
        cy,
        ..full
    };
    Camera::try_from(spec).unwrap()
}

fn pinhole(width: u32, height: u32, focal: f64) -> Camera {
    let text = format!(
        r#"{{"model": "pinhole", "width": {width}, "height": {height}, "fx": {focal}, "fy": {focal}, "cx": {}, "cy": {}}}"#,
        f64::from(width - 1) / 2.0,
        f64::from(height - 1) / 2.0
    );
    let spec: CameraSpec = serde_json::from_str(&text).unwrap();
    assert_eq!(spec.model, CameraModel::Pinhole);
    Camera::try_from(spec).unwrap()
}

/// Depth at which a ray (x, y, 1) t first meets a sphere.
pub fn sphere_depth(x: f64, y: f64, centre: &Vector3<f64>, radius: f64) -> Option<f64> {
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
/// those two: exact at every pixel, also at grazing ones. The mesh is turned so that body and camera frames differ.
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

/// From inside a closed surface every ray must leave through it, also those aimed at its corners and edges.
#[test]
fn no_ray_leaks_through_edges_or_corners() {
    let (vertices, triangles) = bumpy(4);
    let body = Body::from(MeshBody::new(&vertices, &triangles).unwrap());
    // One pixel, whose ray the pose turns onto each target.
    let camera = pinhole(1, 1, 1.0);
    let eye = Point3::new(1.7, -2.3, 0.9);
    for (index, corners) in triangles.iter().enumerate() {
        let [a, b, c] = corners.map(|corner| vertices[corner as usize].cast::<f64>());
        let share = (index as f64 * 0.618_033_988_749_895).fract();
        for target in [a, nalgebra::center(&a, &b), b + (c - b) * share] {
            let body_from_camera =
                Isometry3::face_towards(&eye, &target, &Vector3::new(0.3, 0.8, -0.5));
            let placed = PlacedBody {
                body: &body,
                camera_from_body: body_from_camera.inverse(),
            };
            let z_mm = render(&camera, &[placed]).z_mm[0];
            let distance = (target - eye).norm();
            assert!(
                z_mm > 0.0 && f64::from(z_mm) <= distance + 1e-3,
                "{z_mm} towards {target}, {distance} mm away"
            );
        }
    }
}

/// Rays along the axes of the body run within the planes of its triangles and exactly along edges.
#[test]
fn a_wall_square_to_the_ray_has_no_seams() {
    let side = 65;
    let vertices: Vec<_> = (0..side * side)
        .map(|i| Point3::new((i % side) as f32, (i / side) as f32, 0.0))
        .collect();
    let quad = |x: u32, y: u32| y * side + x;
    let triangles: Vec<_> = (0..side - 1)
        .flat_map(|y| (0..side - 1).map(move |x| (x, y)))
        .flat_map(|(x, y)| {
            let [a, b, c, d] = [
                quad(x, y),
                quad(x + 1, y),
                quad(x, y + 1),
                quad(x + 1, y + 1),
            ];
            [[a, b, c], [b, d, c]]
        })
        .collect();
    let body = Body::from(MeshBody::new(&vertices, &triangles).unwrap());
    // Focal length and distance of equal size: every pixel looks exactly at a corner of the grid.
    let camera = pinhole(side, side, 1024.0);
    let camera_from_body = Isometry3::translation(-32.0, -32.0, 1024.0);
    let image = render(
        &camera,
        &[PlacedBody {
            body: &body,
            camera_from_body,
        }],
    );
    assert!(
        image.z_mm.iter().all(|&z_mm| z_mm == 1024.0),
        "{} of 4225 pixels",
        image.valid_pixels()
    );
}

/// Pixels that see nothing must reach the border through others that see nothing.
fn has_hole(image: &DepthImage) -> bool {
    let (width, height) = (image.width as usize, image.height as usize);
    let mut outside: Vec<bool> = vec![false; width * height];
    let mut stack: Vec<usize> = (0..width * height)
        .filter(|i| [0, width - 1].contains(&(i % width)) || [0, height - 1].contains(&(i / width)))
        .collect();
    while let Some(i) = stack.pop() {
        if image.z_mm[i] > 0.0 || std::mem::replace(&mut outside[i], true) {
            continue;
        }
        let (x, y) = (i % width, i / width);
        let neighbours = [
            (x > 0, -1),
            (x + 1 < width, 1),
            (y > 0, -(width as isize)),
            (y + 1 < height, width as isize),
        ];
        stack.extend(
            neighbours
                .iter()
                .filter(|(inside, _)| *inside)
                .map(|(_, step)| i.strict_add_signed(*step)),
        );
    }
    image
        .z_mm
        .iter()
        .zip(outside)
        .any(|(&z_mm, outside)| z_mm == 0.0 && !outside)
}

#[test]
fn a_closed_surface_has_no_holes_and_threads_change_nothing() {
    let (vertices, triangles) = bumpy(5);
    let body = Body::from(MeshBody::new(&vertices, &triangles).unwrap());
    let camera = small_kinect();
    for turn in 0..6 {
        let camera_from_body = Isometry3::new(
            Vector3::new(5.0, 0.0, 180.0),
            Vector3::new(0.0, f64::from(turn), 0.3),
        );
        let placed = [PlacedBody {
            body: &body,
            camera_from_body,
        }];
        let threads = |count| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(count)
                .build()
                .unwrap()
        };
        let image = threads(1).install(|| render(&camera, &placed));
        assert!(image.valid_pixels() > 3000);
        assert!(!has_hole(&image), "turn {turn}");
        assert_eq!(threads(3).install(|| render(&camera, &placed)), image);
    }
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
    // The ball sticks out of the wall: its rim is behind, its front before the wall.
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
    // What is behind the camera is not seen.
    let behind = PlacedBody {
        camera_from_body: Isometry3::translation(0.0, 0.0, -900.0),
        ..ball
    };
    assert!(render(&camera, &[behind]).require_visible().is_err());
}

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
    // Oblique in its own frame, turned to face the camera.
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

/// Recordings hold repeated points and meshes triangles without area; neither may break the index.
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
