//! The numbers of `../shared/reference/geometry/k4a_camera.json`: three cameras, projected points, unprojected pixels,
//! and the exact depth of a sphere.

use std::path::PathBuf;

use nalgebra::{Isometry3, Point2, Point3, Vector3};
use ppa_depth::{Body, Camera, CameraSpec, MeshBody, PlacedBody, render};
use serde::Deserialize;

use crate::shapes::sphere;

#[derive(Deserialize)]
struct Case {
    camera: CaseCamera,
    points_mm: Vec<[f64; 3]>,
    pixels: Vec<[f64; 2]>,
    inside_metric_radius: Vec<bool>,
    unproject: Unproject,
    sphere_depth: SphereDepth,
}

#[derive(Deserialize)]
struct CaseCamera {
    #[serde(flatten)]
    spec: CameraSpec,
    name: String,
    sphere: Sphere,
}

#[derive(Deserialize)]
struct Sphere {
    centre: [f64; 3],
    r: f64,
}

#[derive(Deserialize)]
struct Unproject {
    pixels: Vec<[f64; 2]>,
    xy: Vec<Option<[f64; 2]>>,
}

#[derive(Deserialize)]
struct SphereDepth {
    pixel_step_xy: [usize; 2],
    z_mm: Vec<f64>,
}

fn cases() -> Vec<Case> {
    let beside = || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared"));
    let shared = std::env::var_os("PPA_SHARED").map_or_else(beside, PathBuf::from);
    let text = std::fs::read_to_string(shared.join("reference/geometry/k4a_camera.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

#[test]
#[ignore = "needs ../shared/reference/geometry/k4a_camera.json"]
fn points_and_pixels_of_three_devices() {
    let (mut worst_px, mut worst_slope) = (0.0_f64, 0.0_f64);
    for case in cases() {
        let camera = Camera::try_from(case.camera.spec).unwrap();
        for ((point, pixel), inside) in case
            .points_mm
            .iter()
            .zip(&case.pixels)
            .zip(case.inside_metric_radius)
        {
            let found = camera.project(&Point3::from(*point));
            assert_eq!(found.is_some(), inside, "{}: {point:?}", case.camera.name);
            if let Some(found) = found {
                let away_px = (found - Point2::from(*pixel)).amax();
                assert!(away_px.is_finite());
                worst_px = worst_px.max(away_px);
            }
        }
        for (pixel, xy) in case.unproject.pixels.iter().zip(&case.unproject.xy) {
            let found = camera.unproject(&Point2::from(*pixel));
            assert_eq!(
                found.is_some(),
                xy.is_some(),
                "{}: {pixel:?}",
                case.camera.name
            );
            if let (Some(found), Some(xy)) = (found, xy) {
                worst_slope = worst_slope.max((found.x - xy[0]).abs().max((found.y - xy[1]).abs()));
            }
        }
    }
    println!("worst: {worst_px:.2e} px projected, {worst_slope:.2e} unprojected");
    assert!(worst_px < 1e-4 && worst_slope < 1e-6);
}

#[test]
#[ignore = "needs ../shared/reference/geometry/k4a_camera.json"]
fn rendered_depth_of_a_sphere() {
    let mut worst_mm = 0.0_f64;
    for case in cases() {
        let Sphere { centre, r } = case.camera.sphere;
        // 8 subdivisions: facets at most 1e-3 mm inside the sphere, a few times that in depth at grazing pixels.
        let (vertices, triangles, inner_mm) = sphere(r, 8);
        assert!(r - inner_mm < 2e-3);
        let body = Body::from(MeshBody::new(&vertices, &triangles).unwrap());
        let camera_from_body = Isometry3::translation(centre[0], centre[1], centre[2])
            * Isometry3::rotation(Vector3::new(1.0, 2.0, 0.5));
        let camera = Camera::try_from(case.camera.spec).unwrap();
        let image = render(
            &camera,
            &[PlacedBody {
                body: &body,
                camera_from_body,
            }],
        );
        let [step_u, step_v] = case.sphere_depth.pixel_step_xy;
        let (width, height) = (image.width as usize, image.height as usize);
        let pixels = (0..height)
            .step_by(step_v)
            .flat_map(|v| (0..width).step_by(step_u).map(move |u| v * width + u));
        for (pixel, z_mm) in pixels.zip(&case.sphere_depth.z_mm) {
            worst_mm = worst_mm.max((f64::from(image.z_mm[pixel]) - z_mm).abs());
        }
    }
    println!("worst: {worst_mm:.4} mm");
    assert!(worst_mm < 0.05);
}
