//! Coverage of surfaces, against spheres and planes.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Point3};
use ppa_depth::{
    Body, Camera, CameraSpec, CoverageError, CoverageSettings, DepthMode, JointSurface, MeshBody,
    PlacedBody, Viewpoint, render,
};

use crate::cameras::pinhole;
use crate::shapes::sphere;

const RADIUS_MM: f64 = 80.0;
const DISTANCE_MM: f64 = 600.0;
const FOCAL_PX: f64 = 500.0;

fn ball() -> MeshBody {
    let (vertices, triangles, _) = sphere(RADIUS_MM, 6);
    MeshBody::new(&vertices, &triangles).unwrap()
}

fn settings(max_angle_deg: f64) -> CoverageSettings {
    CoverageSettings {
        radius_mm: 200.0,
        max_angle_deg,
    }
}

fn before_camera(body: &Body, z_mm: f64) -> PlacedBody<'_> {
    PlacedBody {
        body,
        camera_from_body: Isometry3::translation(0.0, 0.0, z_mm),
    }
}

/// From a distance D the incidence on a sphere of radius R reaches α at the cap of half-angle α − asin(R sin α / D), whose rim lies
/// asin(R sin α / D) off the axis. The facets are 1.1 mm wide, so the rim of the cap is known to some 1.1 mm of its 60 mm.
#[test]
fn a_sphere_shows_the_cap_up_to_the_largest_angle() {
    let mesh = ball();
    let body = Body::from(mesh.clone());
    let camera = pinhole(201, 201, FOCAL_PX);
    let placed = before_camera(&body, DISTANCE_MM);
    for max_angle_deg in [30.0, 60.0, 80.0] {
        let surface =
            JointSurface::new(&mesh, &Point3::origin(), &settings(max_angle_deg)).unwrap();
        assert!((surface.area_mm2() / (4.0 * PI * RADIUS_MM.powi(2)) - 1.0).abs() < 1e-3);
        let seen = surface.seen(&camera, &placed.camera_from_body, &[placed]);
        let angle = f64::to_radians(max_angle_deg);
        let off_axis = (RADIUS_MM * angle.sin() / DISTANCE_MM).asin();
        let cap_mm2 = 2.0 * PI * RADIUS_MM.powi(2) * (1.0 - (angle - off_axis).cos());
        let pixels = PI * (FOCAL_PX * off_axis.tan()).powi(2);
        assert!(
            (seen.visible_mm2 / cap_mm2 - 1.0).abs() < 0.02,
            "{seen:?} {cap_mm2}"
        );
        assert!(
            (seen.pixels / pixels - 1.0).abs() < 0.02,
            "{seen:?} {pixels}"
        );
        let side_mm = (cap_mm2 / pixels).sqrt();
        assert!((seen.mm_per_pixel.unwrap() / side_mm - 1.0).abs() < 0.01);
    }
}

/// Far off the axis of a lens that distorts, up to the rim: the pixels are those that see the ball in an image.
#[test]
fn pixels_are_as_many_as_in_the_image() {
    let mesh = ball();
    let body = Body::from(mesh.clone());
    let camera = Camera::try_from(CameraSpec::azure_kinect(DepthMode::WfovUnbinned)).unwrap();
    let surface = JointSurface::new(&mesh, &Point3::origin(), &settings(89.0)).unwrap();
    for place in [
        [0.0, 0.0, 400.0],
        [300.0, -150.0, 300.0],
        [-400.0, 0.0, 250.0],
    ] {
        let [x, y, z] = place;
        let camera_from_body = Isometry3::translation(x, y, z);
        let placed = PlacedBody {
            body: &body,
            camera_from_body,
        };
        let seen = surface.seen(&camera, &camera_from_body, &[placed]);
        let pixels = render(&camera, &[placed]).valid_pixels() as f64;
        assert!(
            (seen.pixels / pixels - 1.0).abs() < 0.01,
            "{place:?}: {seen:?}, {pixels} pixels"
        );
    }
}

/// A plate that ends in the middle of the image hides half of the cap, and so does the border of the image.
#[test]
fn what_is_hidden_or_beside_the_image_is_not_seen() {
    let mesh = ball();
    let body = Body::from(mesh.clone());
    let corners = [
        (-400.0, -400.0),
        (0.0, -400.0),
        (0.0, 400.0),
        (-400.0, 400.0),
    ];
    let corners = corners.map(|(x, y)| Point3::new(x, y, 0.0_f32));
    let plate = Body::from(MeshBody::new(&corners, &[[0, 1, 2], [0, 2, 3]]).unwrap());
    let camera = pinhole(201, 201, FOCAL_PX);
    let placed = before_camera(&body, DISTANCE_MM);
    let surface = JointSurface::new(&mesh, &Point3::origin(), &settings(70.0)).unwrap();
    let see = |camera: &Camera, scene: &[PlacedBody]| {
        let seen = surface.seen(camera, &scene[0].camera_from_body, scene);
        (seen.visible_mm2, seen.pixels)
    };
    let whole = see(&camera, &[placed]);
    let behind_plate = see(&camera, &[placed, before_camera(&plate, 300.0)]);
    let beside = PlacedBody {
        camera_from_body: Isometry3::translation(100.5 * DISTANCE_MM / FOCAL_PX, 0.0, DISTANCE_MM),
        ..placed
    };
    let cut = see(&camera, &[beside]);
    for (half, slack) in [(behind_plate, 0.02), (cut, 0.04)] {
        assert!(
            (half.0 / whole.0 - 0.5).abs() < slack,
            "{half:?} of {whole:?}"
        );
    }
    // A plate behind the ball hides nothing.
    assert_eq!(see(&camera, &[placed, before_camera(&plate, 700.0)]), whole);
    // Inside the ball there is nothing to see.
    assert_eq!(see(&camera, &[before_camera(&body, 10.0)]), (0.0, 0.0));
}

#[test]
fn nearer_cameras_see_more_finely_and_further_ones_more() {
    let mesh = ball();
    let body = Body::from(mesh.clone());
    let camera = pinhole(401, 401, FOCAL_PX);
    let surface = JointSurface::new(&mesh, &Point3::origin(), &settings(70.0)).unwrap();
    let from = |distance_mm: f64| {
        let above = Viewpoint {
            azimuth_deg: 30.0,
            elevation_deg: 50.0,
            distance_mm,
        };
        let camera_from_body = above.frame_from_camera(&Point3::origin()).inverse();
        let placed = PlacedBody {
            body: &body,
            camera_from_body,
        };
        surface.seen(&camera, &camera_from_body, &[placed])
    };
    let (near, far, further) = (from(300.0), from(600.0), from(601.0));
    assert!(near.pixels_per_cm2 > 2.0 * far.pixels_per_cm2);
    assert!(far.visible_mm2 > 1.1 * near.visible_mm2);
    // Views that show more of the surface come first; of equal ones, the finer.
    let mut views = [near, further, far];
    views.sort_by(ppa_depth::Coverage::best_first);
    assert_eq!(views, [far, further, near]);
}

#[test]
fn settings_that_leave_nothing_are_refused() {
    let mesh = ball();
    let new = |joint: Point3<f64>, radius_mm, max_angle_deg| {
        let settings = CoverageSettings {
            radius_mm,
            max_angle_deg,
        };
        JointSurface::new(&mesh, &joint, &settings).unwrap_err()
    };
    let origin = Point3::origin();
    assert_eq!(new(origin, 0.0, 70.0), CoverageError::Radius(0.0));
    assert!(matches!(
        new(origin, f64::NAN, 70.0),
        CoverageError::Radius(_)
    ));
    assert_eq!(new(origin, 100.0, 90.0), CoverageError::Angle(90.0));
    let far = Point3::new(500.0, 0.0, 0.0);
    assert!(matches!(
        new(far, 100.0, 70.0),
        CoverageError::NoSurface { .. }
    ));
}
