//! `../shared/reference/geometry/room_plane.json`: recorded rooms and their true planes.

use std::path::PathBuf;

use nalgebra::{Point3, Vector3};
use ppa_scene::{PlaneSettings, table_plane};
use serde::Deserialize;

use crate::recorded_room::room_cloud;

/// Lengths in metres.
#[derive(Deserialize)]
struct Case {
    spec: Spec,
    points_after_crop: usize,
    /// n and d of n · p + d = 0.
    truth: [f64; 4],
}

#[derive(Deserialize)]
struct Spec {
    n: u64,
    seed: u64,
    zmin: f64,
    zmax: f64,
    threshold: f64,
}

#[test]
#[ignore = "needs ../shared/reference/geometry/room_plane.json"]
fn planes_are_those_of_the_reference() {
    let beside = || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared"));
    let shared = std::env::var_os("PPA_SHARED").map_or_else(beside, PathBuf::from);
    let text = std::fs::read_to_string(shared.join("reference/geometry/room_plane.json")).unwrap();
    let cases: Vec<Case> = serde_json::from_str(&text).unwrap();
    assert!(!cases.is_empty());
    for Case {
        spec,
        points_after_crop,
        truth: [x, y, z, d],
    } in cases
    {
        let cloud = room_cloud(spec.n, spec.seed, 1e3 * spec.zmin..1e3 * spec.zmax);
        assert_eq!(cloud.points.len(), points_after_crop);
        let settings = PlaneSettings {
            threshold_mm: 1e3 * spec.threshold,
            ..PlaneSettings::default()
        };
        let found = table_plane(&cloud, &settings, 0).unwrap().plane;
        let normal = Vector3::new(x, y, z);
        let angle_deg = found.normal.cross(&normal).norm().asin().to_degrees();
        let offset_mm = found.signed_distance(&Point3::from(-1e3 * d * normal));
        println!(
            "seed {}: {angle_deg:.4} degrees, {offset_mm:.3} mm",
            spec.seed
        );
        assert!(angle_deg <= 0.05 && offset_mm.abs() <= 1.0, "{found:?}");
    }
}
