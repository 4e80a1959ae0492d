//! Voxels that are bone.

use nalgebra::Vector3;
use ppa_ct::Grid;

use super::fill::flooded;

/// Soft tissue, HU.
const SOFT_HU: f32 = 50.0;
/// Lower values are not bone, HU.
const LEAST_HU: f32 = 200.0;
/// Upper limit, the density of cortical bone, HU: otherwise metal would make adjacent bone count as soft tissue.
const MOST_HU: f32 = 1600.0;
/// Search range for the densest place along each axis, mm: from soft tissue past the surface into the cortex.
const NEAR_MM: f64 = 2.0;

/// Density of each voxel from 0 (soft tissue) to 1 (the densest place within 2 mm).
///
/// The surface of a bone is at one half: half-maximum height (Spoor, Zonneveld & Macho, Am J Phys Anthropol 91, 1993, 469).
pub(super) struct Density {
    pub size: [usize; 3],
    pub share: Vec<f32>,
    /// The axis of the lattice that runs along the limb.
    along: usize,
}

impl Density {
    pub fn new(grid: &Grid, hu: Vec<f32>, limb: &Vector3<f64>) -> Self {
        let size = grid.size();
        let spacing = grid.spacing_mm();
        let mut most = hu.clone();
        for axis in 0..3 {
            let reach = (NEAR_MM / spacing[axis]).floor().max(1.0) as usize;
            most = most_along(&most, size, axis, reach);
        }
        let share = hu.iter().zip(most).map(|(&hu, most)| match hu < LEAST_HU {
            true => 0.0,
            false => (hu.min(MOST_HU) - SOFT_HU) / (most.min(MOST_HU) - SOFT_HU),
        });
        let directions = grid.direction();
        let along = |axis: &usize| directions.column(*axis).dot(limb).abs();
        Self {
            size,
            share: share.collect(),
            along: (0..3)
                .max_by(|a, b| along(a).total_cmp(&along(b)))
                .expect("there are three axes"),
        }
    }

    /// Voxels of at least this share, and all voxels that they enclose in a slice across the limb: spongy bone and marrow.
    pub fn solid(&self, least: f32) -> Vec<bool> {
        let mut solid: Vec<bool> = self.share.iter().map(|&share| share >= least).collect();
        let strides = [1, self.size[0], self.size[0] * self.size[1]];
        let [u, v] = [(self.along + 1) % 3, (self.along + 2) % 3];
        let (nu, nv) = (self.size[u], self.size[v]);
        for slice in 0..self.size[self.along] {
            let at = |pixel: usize| {
                slice * strides[self.along] + pixel % nu * strides[u] + pixel / nu * strides[v]
            };
            let border = (0..nu * nv).filter(|pixel| {
                let (x, y) = (pixel % nu, pixel / nu);
                x == 0 || y == 0 || x + 1 == nu || y + 1 == nv
            });
            let outside = flooded([nu, nv, 1], border, |pixel| !solid[at(pixel)]);
            for pixel in (0..nu * nv).filter(|&pixel| !outside[pixel]) {
                solid[at(pixel)] = true;
            }
        }
        solid
    }
}

/// The largest value within `reach` voxels along an axis.
fn most_along(values: &[f32], size: [usize; 3], axis: usize, reach: usize) -> Vec<f32> {
    let stride = size[..axis].iter().product::<usize>();
    let n = size[axis];
    (0..values.len())
        .map(|index| {
            let at = index / stride % n;
            let first = index - at.min(reach) * stride;
            let last = index + (n - 1 - at).min(reach) * stride;
            (first..=last)
                .step_by(stride)
                .map(|other| values[other])
                .fold(f32::NEG_INFINITY, f32::max)
        })
        .collect()
}
