//! Flights from collision to collision by delta tracking: Woodcock et al., ANL-7050 (1965) 557.
//!
//! docs/physics.md, "Fast engine", multiple scatter.

use nalgebra::{Point3, Vector3};
use ppa_core::random::Philox;

use crate::transport::attenuation::{Coefficients, EnergyNode};
use crate::transport::tracking::Transport;

/// Distance that a flight continues beyond a wall, so that it ends in the next block despite rounding.
const BEYOND_MM: f64 = 1e-7;

/// The next collision of a photon.
pub(super) struct Landing {
    pub distance_mm: f64,
    pub material: u8,
    /// Coefficients of the material there.
    pub coefficients: Coefficients,
}

/// Flies from a point along a unit vector to the next collision, if there is one within `length_mm`.
pub(super) fn fly(
    transport: &Transport,
    from: &Point3<f64>,
    direction: &Vector3<f64>,
    length_mm: f64,
    energy: EnergyNode,
    rng: &mut Philox,
) -> Option<Landing> {
    let Transport {
        tables, lattice, ..
    } = transport;
    let majorants = tables.majorants();
    let row = majorants.row(energy);
    let edge = f64::from(majorants.edge);
    let ray = lattice.ray(from, direction);
    let (mut at_mm, leave_mm) = lattice.clip(&ray)?;
    let end_mm = leave_mm.min(length_mm);
    let inverse = ray.slope.map(|slope| 1.0 / slope);
    let mut cell = ray.origin + ray.slope * at_mm;
    let mut depth = optical_depth(rng);
    while at_mm < end_mm {
        let block: [u32; 3] = std::array::from_fn(|axis| {
            ((cell[axis] / edge) as u32).min(majorants.blocks[axis] - 1)
        });
        let [nx, ny, _] = majorants.blocks;
        let region = majorants.region(block[0] + nx * (block[1] + ny * block[2]));
        let bound = f64::from(majorants.bound(row, region));
        let reach = u32::from(region.reach);
        // Distance at which the photon leaves the region.
        let mut wall_mm = f64::INFINITY;
        for axis in 0..3 {
            let face = if ray.slope[axis] > 0.0 {
                f64::from(block[axis] + reach + 1) * edge
            } else if ray.slope[axis] < 0.0 {
                f64::from(block[axis].saturating_sub(reach)) * edge
            } else {
                continue;
            };
            wall_mm = wall_mm.min((face - ray.origin[axis]) * inverse[axis]);
        }
        let collision_mm = at_mm + depth / bound;
        if collision_mm < wall_mm.min(end_mm) {
            at_mm = collision_mm;
            cell = ray.origin + ray.slope * at_mm;
            let code = tables.draw_code(&cell, rng);
            let coefficients = tables.attenuation.at(code.material(), energy);
            let total = f64::from(code.density_g_cm3() * coefficients.total);
            if rng.unit() * bound < total {
                return Some(Landing {
                    distance_mm: at_mm,
                    material: code.material(),
                    coefficients,
                });
            }
            depth = optical_depth(rng);
        } else {
            let next_mm = wall_mm.max(at_mm) + BEYOND_MM;
            depth = (depth - (next_mm - at_mm) * bound).max(0.0);
            at_mm = next_mm;
            cell = ray.origin + ray.slope * at_mm;
        }
    }
    None
}

/// Samples an optical depth of mean 1.
fn optical_depth(rng: &mut Philox) -> f64 {
    // 1 − u is in (0, 1], so the logarithm stays finite.
    -(1.0 - rng.unit()).ln()
}
