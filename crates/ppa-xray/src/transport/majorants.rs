//! Upper bounds of the attenuation around every block of voxels, for Woodcock tracking.

use std::collections::HashMap;

use rayon::prelude::*;

use crate::transport::attenuation::{Attenuation, EnergyNode, NODES};
use crate::transport::voxel_codes::VoxelCode;

/// Voxels along the edge of a block.
pub(crate) const EDGE: u32 = 8;

/// Energy nodes that share a bound: 1/64 octave.
const NODES_PER_ROW: usize = 8;

const ROWS: usize = NODES.div_ceil(NODES_PER_ROW);

/// Classes of blocks at most: a row of bounds stays within four cache lines.
const MOST_CLASSES: usize = 64;

/// A bound below this would let the free path overflow; mm⁻¹.
const VACUUM: f32 = 1e-12;

/// Upper bounds of the attenuation in cubes of blocks.
///
/// A local bound keeps a small dense implant from slowing down the whole box. Blocks with the same largest density per
/// material share a class, so that the table stays small enough for the cache. Every block knows how many blocks around
/// it its bound, or that of a denser neighbour, may serve: photons cross a large even region in one step.
#[derive(Debug)]
pub(crate) struct Majorants {
    /// Blocks along i, j, k.
    pub blocks: [u32; 3],
    regions: Vec<Region>,
    classes: usize,
    /// mm⁻¹, one row of classes per step of energy.
    table: Vec<f32>,
}

/// The cube that a photon in a block may cross under one bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Region {
    class: u16,
    /// Blocks on every side of the photon's own.
    pub reach: u16,
}

impl Majorants {
    /// Bounds for a box of `size` voxels with a mean side of `voxel_mm`.
    pub fn new(
        codes: &[VoxelCode],
        size: [usize; 3],
        voxel_mm: f64,
        attenuation: &Attenuation,
    ) -> Self {
        let blocks = size.map(|n| n.div_ceil(EDGE as usize));
        let materials = attenuation.materials();
        let mut densest = densest_per_block(codes, size, blocks, materials);
        let opacity = relative_opacity(attenuation);
        densest
            .par_chunks_exact_mut(materials)
            .with_min_len(1024)
            .for_each(|row| drop_dominated(row, &opacity));
        let (class, members) = classify(&densest, materials);
        let table = bounds(&members, attenuation);
        let classes = members.len();
        let regions = regions(&class, blocks, &table, classes, voxel_mm);
        Self {
            blocks: blocks.map(|n| n as u32),
            regions,
            classes,
            table,
        }
    }

    /// The row of bounds at an energy.
    #[inline]
    pub fn row(&self, energy: EnergyNode) -> u32 {
        (energy.node as usize / NODES_PER_ROW * self.classes) as u32
    }

    #[inline]
    pub fn region(&self, block: u32) -> Region {
        self.regions[block as usize]
    }

    /// The bound of a region, mm⁻¹, in a [`Majorants::row`].
    #[inline]
    pub fn bound(&self, row: u32, region: Region) -> f32 {
        self.table[row as usize + usize::from(region.class)]
    }
}

/// Largest density of every material in every block, g/cm³.
fn densest_per_block(
    codes: &[VoxelCode],
    size: [usize; 3],
    blocks: [usize; 3],
    materials: usize,
) -> Vec<f32> {
    let edge = EDGE as usize;
    let mut densest = vec![0.0_f32; blocks.iter().product::<usize>() * materials];
    densest
        .par_chunks_exact_mut(blocks[0] * blocks[1] * materials)
        .zip(codes.par_chunks(size[0] * size[1] * edge))
        .for_each(|(layer, codes)| {
            for (line, codes) in codes.chunks_exact(size[0]).enumerate() {
                let row = line % size[1] / edge * blocks[0];
                for (i, codes) in codes.chunks(edge).enumerate() {
                    let block = &mut layer[(row + i) * materials..][..materials];
                    for code in codes {
                        let largest = &mut block[usize::from(code.material())];
                        *largest = largest.max(code.density_g_cm3());
                    }
                }
            }
        });
    densest
}

/// For materials (a, b) at a · materials + b: the largest ratio of their coefficients at any energy.
fn relative_opacity(attenuation: &Attenuation) -> Vec<f32> {
    let materials = attenuation.materials();
    let largest: Vec<Vec<f32>> = (0..materials)
        .map(|material| {
            (0..ROWS)
                .map(|row| largest_in_row(attenuation, material, row))
                .collect()
        })
        .collect();
    (0..materials * materials)
        .map(|pair| {
            let (a, b) = (&largest[pair / materials], &largest[pair % materials]);
            // A hair more, so that rounding never lets a struck-out material pass its bound.
            a.iter().zip(b).map(|(a, b)| a / b).fold(0.0, f32::max) * 1.000_001
        })
        .collect()
}

fn largest_in_row(attenuation: &Attenuation, material: usize, row: usize) -> f32 {
    let first = row * NODES_PER_ROW;
    attenuation.largest(material, first..=(first + NODES_PER_ROW).min(NODES - 1))
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
            if members.len() > MOST_CLASSES {
                break;
            }
        }
        if members.len() <= MOST_CLASSES {
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

/// mm⁻¹ per row and class.
fn bounds(members: &[Vec<f32>], attenuation: &Attenuation) -> Vec<f32> {
    (0..ROWS)
        .flat_map(|row| {
            let largest: Vec<f32> = (0..attenuation.materials())
                .map(|material| largest_in_row(attenuation, material, row))
                .collect();
            members.iter().map(move |densities| {
                densities
                    .iter()
                    .zip(&largest)
                    .map(|(density, mu)| density * mu)
                    .fold(VACUUM, f32::max)
            })
        })
        .collect()
}

/// For every block the cube around it that costs a photon the fewest steps.
fn regions(
    class: &[u16],
    blocks: [usize; 3],
    table: &[f32],
    classes: usize,
    voxel_mm: f64,
) -> Vec<Region> {
    /// Mark of a cube in which no class bounds all others.
    const NONE: u16 = u16::MAX;
    const FARTHEST: u16 = 15;
    let bounds_all: Vec<bool> = (0..classes * classes)
        .map(|pair| {
            let (a, b) = (pair / classes, pair % classes);
            table.chunks_exact(classes).all(|row| row[a] >= row[b])
        })
        .collect();
    let join = |a: u16, b: u16| {
        if a == NONE || b == NONE {
            NONE
        } else if bounds_all[usize::from(a) * classes + usize::from(b)] {
            a
        } else if bounds_all[usize::from(b) * classes + usize::from(a)] {
            b
        } else {
            NONE
        }
    };
    // Steps per mm at about 40 keV: a tentative collision costs about twice the crossing of a wall.
    let typical = &table[ROWS * 3 / 5 * classes..][..classes];
    let steps_per_mm = |class: u16, reach: u16| {
        let side_mm = f64::from((2 * u32::from(reach) + 1) * EDGE) * voxel_mm;
        2.0 * f64::from(typical[usize::from(class)]) + 2.0 / side_mm
    };
    let mut best: Vec<Region> = class
        .iter()
        .map(|&class| Region { class, reach: 0 })
        .collect();
    let mut joined = class.to_vec();
    for reach in 1..=FARTHEST {
        let mut stride = 1;
        for count in blocks {
            let before = joined.clone();
            for (block, joined) in joined.iter_mut().enumerate() {
                let at = block / stride % count;
                if at > 0 {
                    *joined = join(*joined, before[block - stride]);
                }
                if at + 1 < count {
                    *joined = join(*joined, before[block + stride]);
                }
            }
            stride *= count;
        }
        for (best, &class) in best.iter_mut().zip(&joined) {
            if class != NONE && steps_per_mm(class, reach) < steps_per_mm(best.class, best.reach) {
                *best = Region { class, reach };
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::matter::compton::ComptonModel;
    use crate::matter::material::Material;
    use crate::matter::sampler::MaterialTables;

    /// Woodcock tracking is right only if no voxel exceeds the bound of any cube that holds it.
    #[test]
    fn no_voxel_exceeds_the_bound_of_a_cube_around_it() {
        let tables = ["air", "soft_tissue", "bone_cortical", "titanium"].map(|name| {
            MaterialTables::new(&Material::named(name).unwrap(), ComptonModel::default())
        });
        let attenuation = Attenuation::new(&tables);
        let size = [61, 83, 70];
        let coordinates = |n: usize| [n % 61, n / 61 % 83, n / (61 * 83)];
        // Many densities, so that blocks must share classes.
        let scramble = |n: usize| (n.wrapping_mul(2_654_435_761) >> 7) % 10_007;
        let codes: Vec<VoxelCode> = (0..size.iter().product())
            .map(|n| {
                let [i, j, k] = coordinates(n);
                let region = if k < 35 {
                    0
                } else {
                    scramble(i / 5 + j / 5 + k / 5)
                };
                let density = if k < 35 {
                    0.001
                } else {
                    scramble(n) as f32 / 4_000.0
                };
                VoxelCode::new((region % 4) as u8, density)
            })
            .collect();
        let majorants = Majorants::new(&codes, size, 1.0, &attenuation);
        assert!((2..=MOST_CLASSES).contains(&majorants.classes));
        let blocks = majorants.blocks.map(|n| n as usize);
        let mut far_reaching = 0;
        for energy_kev in [5.0, 5.03, 33.17, 59.999, 149.99, 150.0] {
            let energy = attenuation.locate(energy_kev);
            let row = majorants.row(energy);
            for voxel in (0..codes.len()).step_by(7) {
                let total = attenuation.at(codes[voxel].material(), energy).total;
                let mu = codes[voxel].density_g_cm3() * total;
                let home = coordinates(voxel).map(|v| v / EDGE as usize);
                // Every block whose cube reaches the voxel.
                for n in 0..majorants.regions.len() {
                    let at = [
                        n % blocks[0],
                        n / blocks[0] % blocks[1],
                        n / (blocks[0] * blocks[1]),
                    ];
                    let region = majorants.region(n as u32);
                    let reaches =
                        (0..3).all(|a| at[a].abs_diff(home[a]) <= usize::from(region.reach));
                    let bound = majorants.bound(row, region);
                    assert!(
                        !reaches || mu <= bound * (1.0 + 1e-6),
                        "{energy_kev} keV, voxel {voxel}, block {n}: {mu} {bound}"
                    );
                    far_reaching += usize::from(reaches && region.reach > 0);
                }
            }
        }
        assert!(far_reaching > 0, "no cube of more than one block");
    }

    proptest! {
        #[test]
        fn rounding_up_never_rounds_down(density in 1e-6..20.0_f32, ratio in 1.02..3.0_f32) {
            let rounded = round_up(density, ratio);
            prop_assert!(rounded >= density && rounded <= density * ratio * 1.001);
        }
    }
}
