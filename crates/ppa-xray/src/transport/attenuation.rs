//! Attenuation per material and energy, and upper bounds of it per block of voxels.

use std::collections::HashMap;

use crate::matter::sampler::MaterialTables;
use crate::phantom::voxels::VoxelPhantom;

/// Photons below this energy are absorbed on the spot: 5 keV x-rays die within 0.25 mm of tissue.
pub(crate) const CUTOFF_KEV: f64 = 5.0;

/// Highest energy the cross-section data covers.
pub(crate) const CEILING_KEV: f64 = 150.0;

/// Nodes so close that linear interpolation of E⁻³ errs by less than 2.5e-4 at 5 keV, 1e-5 at 30 keV.
const NODES_PER_KEV: usize = 16;

/// Running sums of the interaction coefficients, mm⁻¹ per g/cm³.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Coefficients {
    pub photoelectric: f32,
    pub with_compton: f32,
    /// All three: photoelectric, Compton and Rayleigh.
    pub total: f32,
}

/// Place of an energy between two nodes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EnergyNode {
    node: usize,
    fraction: f32,
}

/// Coefficients of all materials from [`CUTOFF_KEV`] to [`CEILING_KEV`].
#[derive(Debug)]
pub(crate) struct Attenuation {
    nodes: usize,
    /// Material by material.
    table: Vec<Coefficients>,
}

impl Attenuation {
    pub fn new(materials: &[MaterialTables]) -> Self {
        let nodes = (CEILING_KEV - CUTOFF_KEV) as usize * NODES_PER_KEV + 1;
        let table = materials
            .iter()
            .flat_map(|material| {
                (0..nodes).map(move |node| {
                    let energy_kev = CUTOFF_KEV + node as f64 / NODES_PER_KEV as f64;
                    let cm2_g = material.cross_sections(energy_kev);
                    let photoelectric = cm2_g.photoelectric / 10.0;
                    let with_compton = photoelectric + cm2_g.compton / 10.0;
                    Coefficients {
                        photoelectric: photoelectric as f32,
                        with_compton: with_compton as f32,
                        total: (with_compton + cm2_g.rayleigh / 10.0) as f32,
                    }
                })
            })
            .collect();
        Self { nodes, table }
    }

    /// Where `energy_kev`, within the table, lies.
    #[inline]
    pub fn locate(&self, energy_kev: f64) -> EnergyNode {
        let at = (energy_kev - CUTOFF_KEV) * NODES_PER_KEV as f64;
        let node = (at as usize).min(self.nodes - 2);
        EnergyNode {
            node,
            fraction: (at - node as f64) as f32,
        }
    }

    #[inline]
    pub fn at(&self, material: u8, energy: EnergyNode) -> Coefficients {
        let first = usize::from(material) * self.nodes + energy.node;
        let (low, high) = (&self.table[first], &self.table[first + 1]);
        let mix = |a: f32, b: f32| a + energy.fraction * (b - a);
        Coefficients {
            photoelectric: mix(low.photoelectric, high.photoelectric),
            with_compton: mix(low.with_compton, high.with_compton),
            total: mix(low.total, high.total),
        }
    }

    fn materials(&self) -> usize {
        self.table.len() / self.nodes
    }

    /// Largest total coefficient of a material within 1 keV above `CUTOFF_KEV + row`.
    fn largest_in_row(&self, material: usize, row: usize) -> f32 {
        let first = material * self.nodes + row * NODES_PER_KEV;
        self.table[first..=first + NODES_PER_KEV]
            .iter()
            .map(|c| c.total)
            .fold(0.0, f32::max)
    }
}

/// Upper bounds of the attenuation in cubes of voxels, for Woodcock tracking.
///
/// A local bound keeps a small dense implant from slowing down the whole box. Blocks with the same largest
/// density per material share a class, so the table stays small enough for the cache.
#[derive(Debug)]
pub(crate) struct Majorants {
    /// Blocks along i, j, k.
    pub blocks: [u32; 3],
    class: Vec<u16>,
    classes: usize,
    /// mm⁻¹, one row of classes per keV.
    table: Vec<f32>,
}

impl Majorants {
    /// Voxels along the edge of a block.
    pub const EDGE: u32 = 8;

    const MOST_CLASSES: usize = 512;

    pub fn new(phantom: &VoxelPhantom, attenuation: &Attenuation) -> Self {
        let size = phantom.grid().size();
        let edge = Self::EDGE as usize;
        let blocks = size.map(|n| n.div_ceil(edge));
        let materials = attenuation.materials();
        let mut densest = vec![0.0_f32; blocks.iter().product::<usize>() * materials];
        for (voxel, (&material, &density)) in phantom
            .material()
            .iter()
            .zip(phantom.density_g_cm3())
            .enumerate()
        {
            let [i, j, k] = phantom.grid().voxel(voxel).map(|v| v / edge);
            let block = i + blocks[0] * (j + blocks[1] * k);
            let largest = &mut densest[block * materials + usize::from(material)];
            *largest = largest.max(density);
        }
        let rows = (CEILING_KEV - CUTOFF_KEV) as usize;
        let opacity = relative_opacity(attenuation, rows);
        for row in densest.chunks_exact_mut(materials) {
            drop_dominated(row, &opacity);
        }
        let (class, members) = classify(&densest, materials);
        let mut table = Vec::with_capacity(rows * members.len());
        for row in 0..rows {
            let largest: Vec<f32> = (0..materials)
                .map(|material| attenuation.largest_in_row(material, row))
                .collect();
            table.extend(members.iter().map(|densities| {
                densities
                    .iter()
                    .zip(&largest)
                    .map(|(density, mu)| density * mu)
                    .fold(0.0, f32::max)
            }));
        }
        Self {
            blocks: blocks.map(|n| n as u32),
            class,
            classes: members.len(),
            table,
        }
    }

    /// Bounds of all classes at one energy.
    #[inline]
    pub fn row(&self, energy_kev: f64) -> &[f32] {
        let rows = self.table.len() / self.classes;
        let row = ((energy_kev - CUTOFF_KEV) as usize).min(rows - 1);
        &self.table[row * self.classes..(row + 1) * self.classes]
    }

    /// The bound of one block, mm⁻¹, out of a [`Majorants::row`].
    #[inline]
    pub fn bound(&self, row: &[f32], block: usize) -> f64 {
        f64::from(row[usize::from(self.class[block])])
    }
}

/// For materials (a, b) at a · materials + b: the largest ratio of their coefficients at any energy.
fn relative_opacity(attenuation: &Attenuation, rows: usize) -> Vec<f32> {
    let materials = attenuation.materials();
    let largest = |material, row| attenuation.largest_in_row(material, row);
    (0..materials * materials)
        .map(|pair| {
            let (a, b) = (pair / materials, pair % materials);
            let ratio = |row| largest(a, row) / largest(b, row);
            // A hair more, so that rounding never lets a struck-out material pass its bound.
            (0..rows).map(ratio).fold(0.0, f32::max) * 1.000_001
        })
        .collect()
}

/// Strikes out materials that another one of the block outweighs at every energy: they cannot be its bound,
/// and blocks that differ only in them share a class.
fn drop_dominated(densest: &mut [f32], opacity: &[f32]) {
    let materials = densest.len();
    for a in 0..materials {
        let outweighs = |b: usize| a != b && densest[a] * opacity[a * materials + b] <= densest[b];
        if densest[a] > 0.0 && (0..materials).any(outweighs) {
            densest[a] = 0.0;
        }
    }
}

/// Groups rows of `densest` (one density per material); densities are rounded up, as little as the
/// largest number of classes allows.
fn classify(densest: &[f32], materials: usize) -> (Vec<u16>, Vec<Vec<f32>>) {
    let mut ratio = 1.0_f32;
    while ratio < 4.0 {
        let mut known: HashMap<Vec<u32>, u16> = HashMap::new();
        let mut members: Vec<Vec<f32>> = Vec::new();
        let mut class = Vec::with_capacity(densest.len() / materials);
        for row in densest.chunks_exact(materials) {
            let rounded: Vec<f32> = row.iter().map(|&d| round_up(d, ratio)).collect();
            let next = members.len() as u16;
            let index = *known
                .entry(rounded.iter().map(|d| d.to_bits()).collect())
                .or_insert(next);
            if index == next {
                members.push(rounded);
            }
            class.push(index);
            if members.len() > Majorants::MOST_CLASSES {
                break;
            }
        }
        if members.len() <= Majorants::MOST_CLASSES {
            return (class, members);
        }
        ratio = 1.0 + (ratio - 1.0).max(0.01) * 2.0;
    }
    // Too many combinations of materials: one bound for all blocks.
    let mut largest = vec![0.0_f32; materials];
    for row in densest.chunks_exact(materials) {
        for (largest, &density) in largest.iter_mut().zip(row) {
            *largest = largest.max(density);
        }
    }
    (vec![0; densest.len() / materials], vec![largest])
}

/// The smallest power of `ratio` that is not below `density`.
fn round_up(density: f32, ratio: f32) -> f32 {
    if density == 0.0 || ratio == 1.0 {
        return density;
    }
    let exponent = (density.ln() / ratio.ln()).ceil();
    ratio.powf(exponent).max(density)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};
    use ppa_ct::Grid;
    use proptest::prelude::*;

    use super::*;
    use crate::matter::material::Material;

    /// Woodcock tracking is right only if no voxel exceeds the bound of its block.
    #[test]
    fn no_voxel_exceeds_the_bound_of_its_block() {
        let grid =
            Grid::axis_aligned([61, 83, 70], Vector3::repeat(1.0), Point3::origin()).unwrap();
        let materials = ["air", "soft_tissue", "bone_cortical", "titanium"]
            .map(|n| Material::named(n).unwrap());
        // Many densities, so that blocks must share classes.
        let scramble = |n: usize| (n.wrapping_mul(2_654_435_761) >> 7) % 10_007;
        let (material, density) = (0..grid.len())
            .map(|n| {
                let region = scramble(grid.voxel(n).map(|v| v / 5).iter().sum::<usize>());
                ((region % 4) as u8, scramble(n) as f32 / 4_000.0)
            })
            .unzip();
        let phantom = VoxelPhantom::new(grid, material, density, materials.to_vec()).unwrap();
        let tables: Vec<_> = phantom
            .materials()
            .iter()
            .map(MaterialTables::new)
            .collect();
        let attenuation = Attenuation::new(&tables);
        let majorants = Majorants::new(&phantom, &attenuation);
        assert!((2..=Majorants::MOST_CLASSES).contains(&majorants.classes));
        for energy_kev in [5.0, 5.03, 33.17, 59.999, 149.99, 150.0] {
            let (energy, row) = (attenuation.locate(energy_kev), majorants.row(energy_kev));
            for voxel in (0..phantom.grid().len()).step_by(7) {
                let [i, j, k] = phantom.grid().voxel(voxel).map(|v| v / 8);
                let blocks = majorants.blocks.map(|n| n as usize);
                let bound = majorants.bound(row, i + blocks[0] * (j + blocks[1] * k));
                let total = attenuation.at(phantom.material()[voxel], energy).total;
                let mu = f64::from(phantom.density_g_cm3()[voxel] * total);
                assert!(
                    mu <= bound * (1.0 + 1e-6),
                    "{energy_kev} keV, voxel {voxel}: {mu} {bound}"
                );
            }
        }
    }

    proptest! {
        #[test]
        fn rounding_up_never_rounds_down(density in 1e-6..20.0_f32, ratio in 1.02..3.0_f32) {
            let rounded = round_up(density, ratio);
            prop_assert!(rounded >= density && rounded <= density * ratio * 1.001);
        }
    }
}
