//! Cubes of voxels of equal mean attenuation, few enough for the cache.
//!
//! They give optical depths whose bias [`single_scatter`](super::single_scatter) and [`multiple_scatter`](super::multiple_scatter) remove
//! with a randomly sampled correction; docs/physics.md, "Fast engine", single scatter.

use rayon::prelude::*;

use crate::engine::attenuation_basis::{AttenuationBasis, LANES, add};
use crate::phantom::voxels::VoxelPhantom;

/// Cubes of voxels, each with its mean density of every basis material.
pub(super) struct CoarseCells {
    /// Voxels along the edge of a cube.
    pub edge: usize,
    /// Cubes along each axis.
    pub size: [usize; 3],
    /// g/cm³, x fastest.
    pub density: Vec<[f32; LANES]>,
}

impl CoarseCells {
    /// Builds at most `most_cells` cubes.
    pub fn new(phantom: &VoxelPhantom, basis: &AttenuationBasis, most_cells: usize) -> Self {
        let voxels = phantom.grid().size();
        let mut edge = 1;
        while voxels.iter().map(|n| n.div_ceil(edge)).product::<usize>() > most_cells {
            edge += 1;
        }
        let size = voxels.map(|n| n.div_ceil(edge));
        let groups = basis.groups;
        let mut density = vec![[0.0_f32; LANES]; groups * size.iter().product::<usize>()];
        let layer = groups * size[0] * size[1];
        density
            .par_chunks_mut(layer)
            .enumerate()
            .for_each(|(k, layer)| {
                let range =
                    |cell: usize, axis: usize| cell * edge..((cell + 1) * edge).min(voxels[axis]);
                for (cell, density) in layer.chunks_exact_mut(groups).enumerate() {
                    let (i, j) = (cell % size[0], cell / size[0]);
                    let mut count = 0.0;
                    for z in range(k, 2) {
                        for y in range(j, 1) {
                            for x in range(i, 0) {
                                let voxel = x + voxels[0] * (y + voxels[1] * z);
                                let shares = basis.shares(phantom.material()[voxel]);
                                add(density, shares, phantom.density_g_cm3()[voxel]);
                                count += 1.0;
                            }
                        }
                    }
                    for lane in density.iter_mut().flatten() {
                        *lane /= count;
                    }
                }
            });
        Self {
            edge,
            size,
            density,
        }
    }
}
