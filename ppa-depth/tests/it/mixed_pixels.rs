//! Pixels that see two surfaces.

use nalgebra::{Isometry3, Point3, Vector3};
use ppa_depth::{Body, Camera, DepthImage, Invalidation, MeshBody, MixedPixels, SensorSpec};

use crate::sensor::{NONE, pinhole, sensor, view, wall};
use crate::shapes::bumpy;

/// A near wall covers a known share of one column of pixels; the phasors of both walls then give the range.
#[test]
fn a_pixel_that_sees_two_walls_has_the_phase_of_their_light() {
    let camera = Camera::try_from(pinhole(101, 1000.0)).unwrap();
    let (near, far, megahertz) = (1000.0_f64, 1200.0_f64, 200.0);
    // The edge lies 1/4 pixel left of the middle of column 60: a quarter of its width (2 of 8 columns of samples) is near.
    let edge = (60.0 - 50.0 - 0.25) * near / 1000.0;
    let seen = view(
        &camera,
        &[&wall(-9e3, 9e3, far as f32)],
        &wall(-9e3, edge as f32, near as f32),
    );
    let mixing = SensorSpec {
        mixed: Some(MixedPixels {
            modulation_mhz: megahertz,
        }),
        ..NONE
    };
    let image = sensor(mixing.clone())
        .observe(&camera, &seen, 1, 0)
        .unwrap();
    let at = |image: &DepthImage, column: usize| f64::from(image.z_mm[50 * 101 + column]);
    assert!((at(&image, 58) - near).abs() < 0.05 && (at(&image, 62) - far).abs() < 0.05);
    let length = (1.0 + (10.0_f64 / 1000.0).powi(2)).sqrt();
    let phase = 4.0 * std::f64::consts::PI * megahertz / 299_792.458;
    let (a, b) = (0.25 / near.powi(2), 0.75 / far.powi(2));
    let turn = phase * (far - near) * length;
    let range = near * length + (b * turn.sin()).atan2(a + b * turn.cos()) / phase;
    assert!(
        (at(&image, 60) - range / length).abs() < 0.1,
        "{} {}",
        at(&image, 60),
        range / length
    );
    // Its contrast decides whether it is rejected.
    let contrast = (a + b * turn.cos()).hypot(b * turn.sin()) / (a + b);
    for (limit, given_up) in [(contrast - 0.005, false), (contrast + 0.005, true)] {
        let spec = SensorSpec {
            invalid: Some(Invalidation {
                min_signal: 0.0,
                max_angle_deg: 90.0,
                min_contrast: limit,
            }),
            ..mixing.clone()
        };
        let image = sensor(spec).observe(&camera, &seen, 1, 0).unwrap();
        assert_eq!(at(&image, 60) == 0.0, given_up);
        assert!(at(&image, 58) > 0.0 && at(&image, 62) > 0.0);
    }
}

/// If all triangles are small, only those near sites are examined further; a triangle behind the camera in every chunk
/// causes all of them to be examined. Both give the same image.
#[test]
fn triangles_that_are_skipped_would_not_have_been_seen() {
    let camera = Camera::try_from(pinhole(160, 500.0)).unwrap();
    let (vertices, triangles) = bumpy(6);
    let turned = Isometry3::new(
        Vector3::new(20.0, -80.0, 800.0),
        Vector3::new(0.4, 0.9, -0.2),
    );
    let vertices: Vec<Point3<f32>> = vertices
        .iter()
        .map(|p| (turned * p.cast::<f64>()).cast())
        .collect();
    let small = MeshBody::new(&vertices, &triangles).unwrap();
    let mut with_behind = vertices.clone();
    let behind = [0, 1, 2].map(|i| (vertices.len() + i) as u32);
    with_behind.extend([(0.0, 0.0), (9.0, 0.0), (0.0, 9.0)].map(|(x, y)| Point3::new(x, y, -50.0)));
    let all: Vec<[u32; 3]> = triangles
        .chunks(1000)
        .flat_map(|part| part.iter().copied().chain([behind]))
        .collect();
    let slow = MeshBody::new(&with_behind, &all).unwrap();
    let mixing = sensor(SensorSpec {
        mixed: Some(MixedPixels {
            modulation_mhz: 200.0,
        }),
        ..NONE
    });
    let wall = wall(-9e3, 9e3, 1100.0);
    let [small, slow] = [small, slow].map(|mesh| {
        let seen = view(&camera, &[&wall], &Body::from(mesh));
        mixing.observe(&camera, &seen, 1, 0).unwrap()
    });
    assert!(
        small.z_mm.iter().any(|z| (900.0..1050.0).contains(z)),
        "no pixel sees two surfaces"
    );
    assert_eq!(small, slow);
}
