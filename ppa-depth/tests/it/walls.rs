//! A tube whose end was cut off: views of the wall that closes it.

use nalgebra::{Isometry3, Point3, Vector3};
use ppa_depth::{
    Backdrop, Body, BodyError, Camera, DepthImage, MeshBody, MixedPixels, Multipath, PlacedBody,
    Sensor, SensorSpec, WallDepth, render, render_before,
};
use std::f64::consts::TAU;

use crate::cameras::{pinhole, small_kinect};
use crate::sensor::{NONE, wall};

const RADIUS_MM: f64 = 60.0;
const LENGTH_MM: f64 = 150.0;
const SIDES: u32 = 360;

type Triangles = Vec<[u32; 3]>;

/// A tube around z from its cut end at 0 to its closed end at 150 mm, and the wall across the cut.
fn tube() -> (Vec<Point3<f32>>, Triangles, Triangles) {
    let around = |side: u32, z: f64| {
        let angle = TAU * f64::from(side) / f64::from(SIDES);
        Point3::new(RADIUS_MM * angle.cos(), RADIUS_MM * angle.sin(), z).cast()
    };
    let ring = |z: f64| (0..SIDES).map(move |side| around(side, z));
    let vertices = ring(0.0).chain(ring(LENGTH_MM)).collect();
    let mut skin = Vec::new();
    for side in 0..SIDES {
        let next = (side + 1) % SIDES;
        skin.extend([
            [side, side + SIDES, next],
            [next, side + SIDES, next + SIDES],
        ]);
    }
    let fan = |first: u32| (1..SIDES - 1).map(move |side| [first, first + side, first + side + 1]);
    skin.extend(fan(SIDES));
    (vertices, skin, fan(0).collect())
}

fn bodies() -> [Body; 2] {
    let (vertices, skin, cut) = tube();
    let open = MeshBody::new(&vertices, &skin).unwrap();
    let closed = open.clone().with_walls(&cut).unwrap();
    [open.into(), closed.into()]
}

fn placed(body: &Body, camera_from_body: Isometry3<f64>) -> [PlacedBody<'_>; 1] {
    [PlacedBody {
        body,
        camera_from_body,
    }]
}

/// The cut end towards the camera.
fn ahead(z_mm: f64) -> Isometry3<f64> {
    Isometry3::translation(0.0, 0.0, z_mm)
}

fn table(camera: &Camera, z_mm: f32) -> DepthImage {
    render(
        camera,
        &placed(&wall(-9e3, 9e3, z_mm), Isometry3::identity()),
    )
}

/// Distance of the ray through a pixel from the axis, in the plane of the cut, mm.
fn off_axis(camera: &Camera, pixel: usize, z_mm: f64) -> f64 {
    camera.rays()[pixel].unwrap().norm() * z_mm
}

#[test]
fn a_cut_end_is_flat_or_invalid_but_never_a_hole() {
    let camera = pinhole(201, 201, 800.0);
    let [open, closed] = bodies();
    let (end_mm, table_mm) = (900.0, 1500.0);
    let background = table(&camera, table_mm);
    let before = |body, walls| {
        render_before(&camera, &placed(body, ahead(end_mm)), &background, walls).unwrap()
    };
    let hole = before(&open, WallDepth::Flat);
    let flat = before(&closed, WallDepth::Flat);
    let invalid = before(&closed, WallDepth::Invalid);
    assert!(hole.wall_pixels.is_empty());
    assert_eq!(flat.wall_pixels, invalid.wall_pixels);
    let (mut on_wall, mut deep) = (0, 0);
    for pixel in 0..201 * 201 {
        let off_mm = off_axis(&camera, pixel, end_mm);
        let [through, flat_mm, left] = [&hole, &flat, &invalid].map(|seen| seen.image.z_mm[pixel]);
        let listed = flat.wall_pixels.binary_search(&(pixel as u32)).is_ok();
        if off_mm < RADIUS_MM - 0.1 {
            on_wall += 1;
            assert!(listed && (flat_mm - end_mm as f32).abs() < 1e-2 && left == 0.0);
            deep += usize::from(through > end_mm as f32 + 100.0);
        } else if off_mm > RADIUS_MM + 0.1 {
            assert!(!listed);
            assert_eq!([flat_mm, left], [through; 2], "unchanged beside the cut");
        }
    }
    assert!(
        on_wall > 5000 && deep > 5000,
        "without walls a camera sees {deep} pixels of the inside"
    );
    // A wall is a surface like any other.
    let image = render(&camera, &placed(&closed, ahead(end_mm)));
    assert!((image.z_mm[100 * 201 + 100] - end_mm as f32).abs() < 1e-2);
}

#[test]
fn a_cut_end_on_the_far_side_changes_nothing() {
    let camera = small_kinect();
    let [open, closed] = bodies();
    let background = table(&camera, 1500.0);
    let backdrop = Backdrop::new(
        &camera,
        &placed(&wall(-9e3, 9e3, 1500.0), Isometry3::identity()),
    );
    let sensor = Sensor::new(SensorSpec::default(), 3).unwrap();
    let away = Isometry3::new(
        Vector3::new(30.0, -20.0, 900.0),
        Vector3::new(2.6, 0.3, 0.0),
    );
    for walls in [WallDepth::Flat, WallDepth::Invalid] {
        let [hole, seen] = [&open, &closed]
            .map(|body| render_before(&camera, &placed(body, away), &background, walls).unwrap());
        assert_eq!(hole, seen);
        let [hole, seen] = [&open, &closed].map(|body| {
            let seen = backdrop
                .before_with_walls(&camera, &placed(body, away), walls)
                .unwrap();
            assert!(seen.wall_pixels.is_empty());
            sensor.observe(&camera, &seen, 1, 0).unwrap()
        });
        assert_eq!(hole, seen);
    }
}

#[test]
fn what_stands_before_a_wall_is_seen() {
    let camera = pinhole(101, 101, 500.0);
    let [_, closed] = bodies();
    // The left half of the wall is hidden.
    let screen = render(
        &camera,
        &placed(&wall(-9e3, 0.0, 500.0), Isometry3::identity()),
    );
    let seen = render_before(
        &camera,
        &placed(&closed, ahead(900.0)),
        &screen,
        WallDepth::Invalid,
    )
    .unwrap();
    assert!(seen.wall_pixels.iter().all(|pixel| pixel % 101 > 50));
    assert!(seen.wall_pixels.len() > 1000);
    assert_eq!(seen.image.z_mm[50 * 101 + 40], 500.0);
}

/// Light of an invalid wall may not mix with that of the table behind its edge, nor reach it by a bounce.
#[test]
fn an_invalid_wall_gives_no_light_to_a_sensor() {
    let camera = pinhole(201, 201, 800.0);
    let [_, closed] = bodies();
    let (end_mm, table_mm) = (900.0, 1500.0);
    let backdrop = Backdrop::new(
        &camera,
        &placed(&wall(-9e3, 9e3, table_mm), Isometry3::identity()),
    );
    let spec = SensorSpec {
        mixed: Some(MixedPixels {
            modulation_mhz: 200.0,
        }),
        ..NONE
    };
    let bouncing = SensorSpec {
        multipath: Some(Multipath {
            albedo: 0.5,
            modulation_mhz: 200.0,
        }),
        ..NONE
    };
    let seen = |walls| {
        backdrop
            .before_with_walls(&camera, &placed(&closed, ahead(end_mm)), walls)
            .unwrap()
    };
    let observe = |spec: &SensorSpec, walls| {
        Sensor::new(spec.clone(), 1)
            .unwrap()
            .observe(&camera, &seen(walls), 1, 0)
            .unwrap()
    };
    let (mixed, clean) = (
        observe(&spec, WallDepth::Flat),
        observe(&spec, WallDepth::Invalid),
    );
    let between = |z: f32| z > 1.0 && z < table_mm - 1.0 && (z - end_mm as f32).abs() > 1.0;
    let at_rim = |image: &DepthImage| image.z_mm.iter().filter(|z| between(**z)).count();
    assert!(at_rim(&mixed) > 100, "{}", at_rim(&mixed));
    assert_eq!(at_rim(&clean), 0);
    // Half a pixel outside the rim, no sample can see the wall.
    let half_px_mm = 0.5 * 2.0_f64.sqrt() * end_mm / 800.0;
    for (pixel, z_mm) in clean.z_mm.iter().enumerate() {
        let off_mm = off_axis(&camera, pixel, end_mm);
        if off_mm < RADIUS_MM - 0.1 {
            assert_eq!(*z_mm, 0.0);
        } else if off_mm > RADIUS_MM + half_px_mm + 0.1 {
            assert!((z_mm - table_mm).abs() < 1e-2, "{z_mm} at {off_mm} mm");
        }
    }
    // Only the table is left: a plane sends itself no light.
    let bounced = observe(&bouncing, WallDepth::Invalid);
    let moved = |image: &DepthImage| {
        let depths = image.z_mm.iter().filter(|z| **z > 0.0);
        depths.map(|z| (z - table_mm).abs()).fold(0.0, f32::max)
    };
    assert!(moved(&bounced) < 1e-2, "{}", moved(&bounced));
}

#[test]
fn a_camera_behind_the_wall_is_inside() {
    let [open, closed] = bodies();
    let within = Isometry3::translation(0.0, 0.0, -0.5 * LENGTH_MM);
    assert_eq!(placed(&open, within)[0].require_camera_outside(), Ok(()));
    assert!(matches!(
        placed(&closed, within)[0].require_camera_outside(),
        Err(BodyError::CameraInside { .. })
    ));
    let (vertices, skin, _) = tube();
    let missing = MeshBody::new(&vertices, &skin)
        .unwrap()
        .with_walls(&[[0, 1, 2], [0, 5000, 2]]);
    assert_eq!(
        missing.unwrap_err(),
        BodyError::Vertex {
            triangle: 1,
            vertex: 5000,
            vertices: 2 * SIDES as usize
        }
    );
}
