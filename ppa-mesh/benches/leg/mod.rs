//! The volume on which other programs are measured too (`benches/peers/surfaces.py`): a lower leg with fat, muscle,
//! bones and pockets of gas on a curved table, in 26.2 million voxels of 16 bits.

use std::f64::consts::PI;

use nalgebra::{Point3, Vector3};
use ppa_ct::{Grid, Volume};
use ppa_tests::hash_noise;
use rayon::prelude::*;

const SIZE: [usize; 3] = [256, 256, 400];
const SPACING_MM: Vector3<f64> = Vector3::new(0.8, 0.8, 1.0);
const SEED: u64 = 7;
/// Middle (x, y from the axis; z from the first slice) and radius, mm.
const GAS: [[f64; 4]; 4] = [
    [10.0, 5.0, 80.0, 5.0],
    [-6.0, 12.0, 190.0, 4.0],
    [14.0, -8.0, 250.0, 6.0],
    [0.0, 18.0, 330.0, 3.5],
];

pub fn leg() -> Volume {
    let [nx, ny, nz] = SIZE;
    let grid = Grid::axis_aligned(SIZE, SPACING_MM, Point3::origin()).expect("grid");
    let slices = (0..nz).into_par_iter().flat_map_iter(|k| {
        (0..nx * ny).map(move |at| {
            let middle = |n: usize| (n - 1) as f64 / 2.0;
            let x = ((at % nx) as f64 - middle(nx)) * SPACING_MM.x;
            let y = ((at / nx) as f64 - middle(ny)) * SPACING_MM.y;
            let noise = 30.0 * hash_noise(at as u64, SEED * 4096 + k as u64);
            let hu = hu(x, y, k as f64 * SPACING_MM.z, k as f64 / (nz - 1) as f64) + noise;
            hu.round_ties_even().clamp(-1024.0, 3071.0) as i16
        })
    });
    Volume::from_i16(grid, slices.collect()).expect("as many as the grid has")
}

/// HU without noise; `along` is 0 at the ankle and 1 below the knee.
fn hu(x: f64, y: f64, z: f64, along: f64) -> f64 {
    let a = 32.0 + 22.0 * along + 7.0 * (PI * along).sin();
    let b = 30.0 + 20.0 * along + 10.0 * (PI * along).sin().powi(2);
    let cx = 4.0 * (2.0 * PI * along).sin();
    let cy = 62.0 - b - 0.3 + 6.0 * along * (1.0 - along);
    let skin = (((x - cx) / a).hypot((y - cy) / b) - 1.0) * a.min(b);
    let muscle = skin + 6.0 + 3.0 * along;
    let tibia = (x - cx + 0.30 * a).hypot(y - cy + 0.35 * b) - (11.0 + 4.0 * along);
    let fibula = (x - cx - 0.45 * a).hypot(y - cy - 0.05 * b) - 6.0;
    let top = 62.0 - x * x / 700.0;
    let mat = (top - y).max(y - (top + 6.0));
    let shell = (top + 6.0 - y).max(y - 96.0).max(x.abs() - 96.0);
    let foam = (top + 8.4 - y).max(y - 93.6).max(x.abs() - 93.6);
    let layers = [
        (mat, -820.0),
        (shell, -80.0),
        (foam, -930.0),
        (skin, -100.0),
        (muscle, 50.0),
        (tibia, 1200.0),
        (tibia + 3.0, 60.0),
        (fibula, 1100.0),
        (fibula + 2.5, 50.0),
    ];
    let gas = GAS.map(|[gx, gy, gz, radius]| {
        let from_middle = Vector3::new(x - cx - gx, y - cy - gy, z - gz);
        (from_middle.norm() - radius, -990.0)
    });
    // Edges are as wide as a scanner's: a logistic of 0.6 mm.
    let inside = |distance: f64| 1.0 / (1.0 + (distance / 0.6).clamp(-60.0, 60.0).exp());
    let over = |hu: f64, (distance, of): (f64, f64)| hu + inside(distance) * (of - hu);
    layers.into_iter().chain(gas).fold(-1000.0, over)
}
