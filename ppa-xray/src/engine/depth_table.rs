//! Optical depths of the body along rays from one point of the detector, at the typical energy of the importance model.
//!
//! docs/physics.md, "Fast engine", single scatter.

use nalgebra::{Point3, Vector3};

use crate::engine::cell_walk::Step;
use crate::engine::paths::Paths;

/// Rays per side, and depths along each.
pub(super) const RAYS: usize = 32;
pub(super) const DEPTHS: usize = 64;

/// Rays at equal steps of stereographic coordinates, which have no pole on this side of the detector plane.
#[derive(Debug)]
pub(super) struct DepthTable {
    pub low: [f32; 2],
    /// Rays per unit of the coordinates.
    pub per_unit: [f32; 2],
    /// Distance of the first depth from the point.
    pub near_mm: f32,
    pub depths_per_mm: f32,
    /// Optical depths, ray by ray.
    pub depths: Vec<f32>,
}

impl Default for DepthTable {
    fn default() -> Self {
        Self {
            low: [0.0; 2],
            per_unit: [0.0; 2],
            near_mm: 0.0,
            depths_per_mm: 0.0,
            depths: vec![0.0; RAYS * RAYS * DEPTHS],
        }
    }
}

impl DepthTable {
    /// Tabulates depths from `target` to points in the box with these `corners`, whose coarse cells have attenuations `mu_per_mm`.
    pub fn tabulate(
        &mut self,
        paths: &Paths,
        mu_per_mm: &[f32],
        corners: &[Point3<f64>; 8],
        target: &Point3<f64>,
    ) {
        let corners = corners.map(|corner| corner - target);
        let middle: Vector3<f64> = corners.iter().sum::<Vector3<f64>>() / 8.0;
        let radius_mm = (corners[0] - middle).norm();
        let near_mm = (middle.norm() - radius_mm).max(0.0);
        let step_mm = (middle.norm() + radius_mm - near_mm) / (DEPTHS - 1) as f64;
        let low_high = if corners.iter().any(|corner| corner.z >= 0.0) {
            [[-1.0, 1.0]; 2] // the box reaches behind the plane: all directions before it
        } else {
            let seen = corners.map(|corner| stereographic(&corner));
            [0, 1].map(|axis| {
                let along = seen.map(|at| at[axis]);
                let low = along.iter().copied().fold(f64::INFINITY, f64::min);
                [low, along.iter().copied().fold(-f64::INFINITY, f64::max)]
            })
        };
        let pitch = low_high.map(|[low, high]| (high - low).max(1e-6) / (RAYS - 1) as f64);
        self.low = low_high.map(|[low, _]| low as f32);
        self.per_unit = pitch.map(|pitch| (1.0 / pitch) as f32);
        self.near_mm = near_mm as f32;
        self.depths_per_mm = (1.0 / step_mm) as f32;
        for (ray, depths) in self.depths.chunks_exact_mut(DEPTHS).enumerate() {
            let at = [ray % RAYS, ray / RAYS];
            let [x, y] = [0, 1].map(|axis| low_high[axis][0] + at[axis] as f64 * pitch[axis]);
            let square = x * x + y * y;
            let direction = Vector3::new(2.0 * x, 2.0 * y, square - 1.0) / (1.0 + square);
            let end_mm = near_mm + step_mm * DEPTHS as f64;
            let (mut depth, mut next) = (0.0_f32, 0);
            paths.coarse_pieces(target, &direction, end_mm, |cell, from_mm, to_mm| {
                let mu = mu_per_mm[cell];
                while next < DEPTHS {
                    let at_mm = near_mm + step_mm * next as f64;
                    if at_mm >= to_mm {
                        break;
                    }
                    depths[next] = depth + mu * (at_mm - from_mm).max(0.0) as f32;
                    next += 1;
                }
                depth += mu * (to_mm - from_mm) as f32;
                Step::Continue(())
            });
            depths[next..].fill(depth);
        }
    }
}

/// Stereographic coordinates of a direction towards −z.
fn stereographic(direction: &Vector3<f64>) -> [f64; 2] {
    let scale = 1.0 / (direction.norm() - direction.z);
    [direction.x * scale, direction.y * scale]
}
