//! The noisy room on which other programs were measured.

use nalgebra::{Point3, Vector3};
use ppa_mesh::PointCloud;
use ppa_tests::hash_noise;

/// A noisy room in mm: table of 2.0 x 0.6 m at 900 mm, floor at 0, wall at y = 1.5 m, clutter;
/// noise of 3 mm standard deviation. `keep` picks heights before rounding to f32.
pub fn room_cloud(n: u64, seed: u64, keep: std::ops::Range<f64>) -> PointCloud {
    let uniform = |i: u64, which: u64| (hash_noise(i, seed + 10 * which) + 1.0) / 2.0;
    let noise = |i: u64, which: u64| hash_noise(i, seed + 10 * which + 5) * 2.45 * 3.0;
    let points = (0..n)
        .map(|i| {
            let (u, v, w) = (uniform(i, 0), uniform(i, 1), uniform(i, 2));
            let (x, y) = (u * 4000.0 - 2000.0, v * 3000.0 - 1500.0);
            let p = match i % 100 {
                0..30 => Point3::new(u * 2000.0 - 1000.0, v * 600.0 - 300.0, 900.0),
                30..65 => Point3::new(x, y, 0.0),
                65..85 => Point3::new(x, 1500.0, v * 2500.0),
                _ => Point3::new(x, y, w * 2500.0),
            };
            p + Vector3::new(noise(i, 0), noise(i, 1), noise(i, 2))
        })
        .filter(|p| keep.contains(&p.z))
        .map(|p| p.cast())
        .collect();
    PointCloud {
        points,
        normals: Vec::new(),
    }
}
