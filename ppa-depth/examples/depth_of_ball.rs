//! A ball one metre in front of an Azure Kinect: the ideal depth image, and the one that the sensor measures.
//!
//! `cargo run -p ppa-depth --example depth_of_ball`

use std::error::Error;
use std::f32::consts::{PI, TAU};

use nalgebra::{Isometry3, Point3};
use ppa_depth::{
    Backdrop, Body, Camera, CameraSpec, DepthMode, MeshBody, PlacedBody, Sensor, SensorSpec,
};

fn main() -> Result<(), Box<dyn Error>> {
    let body = Body::from(ball(150.0, 64)?);
    let placed = PlacedBody {
        body: &body,
        camera_from_body: Isometry3::translation(0.0, 0.0, 1000.0),
    };
    let camera = Camera::try_from(CameraSpec::azure_kinect(DepthMode::NfovUnbinned))?;
    let seen = Backdrop::new(&camera, &[]).before(&camera, &[placed])?;
    let measured = Sensor::new(SensorSpec::default(), 1)?.observe(&camera, &seen, 7, 0)?;

    let folder = tempfile::tempdir()?;
    for (name, image) in [("ideal", &seen.image), ("measured", &measured)] {
        image.write_png(&folder.path().join(format!("{name}.png")))?;
        let (pixels, nearest) = (image.valid_pixels(), image.min_mm());
        println!("{name}: {pixels} pixels, the nearest at {nearest:.1?} mm");
    }
    Ok(())
}

/// A ball of `steps` rings with twice as many corners each, centred at the origin.
fn ball(radius_mm: f32, steps: u32) -> Result<MeshBody, ppa_depth::BodyError> {
    let around = 2 * steps;
    let corner = |ring: u32, n: u32| {
        let (sin, cos) = (PI * ring as f32 / steps as f32).sin_cos();
        let (y, x) = (TAU * n as f32 / around as f32).sin_cos();
        radius_mm * Point3::new(sin * x, sin * y, cos)
    };
    let vertices: Vec<_> = (0..=steps)
        .flat_map(|ring| (0..around).map(move |n| corner(ring, n)))
        .collect();
    let triangles: Vec<_> = (0..steps * around)
        .flat_map(|at| {
            let next = at - at % around + (at + 1) % around;
            [[at, at + around, next], [next, at + around, next + around]]
        })
        .collect();
    MeshBody::new(&vertices, &triangles)
}
