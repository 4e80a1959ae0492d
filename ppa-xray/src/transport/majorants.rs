//! Upper bounds of the attenuation around every block of voxels, for Woodcock tracking.

use rayon::prelude::*;

use crate::transport::attenuation::{Attenuation, EnergyNode, NODES};
use crate::transport::block_classes::{classify, densest_per_block, strongest};
use crate::transport::voxel_codes::VoxelCodes;

/// Voxels along the edge of a block.
const EDGE: u32 = 8;

/// Energy nodes that share a bound: 1/64 octave.
const NODES_PER_ROW: usize = 8;

const ROWS: usize = NODES.div_ceil(NODES_PER_ROW);

/// Energy at which blocks are compared, keV: the middle of a radiograph's spectrum.
const TYPICAL_KEV: f64 = 40.0;

/// Upper bounds of the attenuation in cubes of blocks.
///
/// Local bounds prevent a small dense implant from slowing down the entire box. Blocks of similar opacity
/// share a class; classes are ordered, and the bound of a class is valid for all lower ones. Every block stores how many blocks around it
/// may share its bound, or that of a more opaque neighbour, so photons cross a large uniform region in one step.
#[derive(Debug)]
pub(crate) struct Majorants {
    /// Voxels along the edge of a block; a power of two, so that its inverse is exact.
    pub edge: u32,
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
    /// Computes bounds for a box of voxels with a mean side of `voxel_mm`, in blocks of [`EDGE`]; they cover `halo` voxels around each
    /// block.
    pub fn new(codes: &VoxelCodes, halo: usize, voxel_mm: f64, attenuation: &Attenuation) -> Self {
        Self::in_blocks(EDGE, codes, halo, voxel_mm, attenuation)
    }

    /// The same as [`Majorants::new`], in blocks of `edge` voxels.
    pub fn in_blocks(
        edge: u32,
        codes: &VoxelCodes,
        halo: usize,
        voxel_mm: f64,
        attenuation: &Attenuation,
    ) -> Self {
        let blocks = codes.size().map(|n| (n - 2).div_ceil(edge as usize));
        let materials = attenuation.materials();
        let densest = densest_per_block(codes, halo, (edge as usize, blocks), materials);
        let row_of = |energy: EnergyNode| energy.node as usize / NODES_PER_ROW;
        let typical = row_of(attenuation.locate(TYPICAL_KEV));
        let (class, members) = classify(&densest, &largest_in_row(attenuation, typical));
        let table = bounds(&members, attenuation);
        let classes = members.len() / materials;
        let typical_mm = &table[typical * classes..][..classes];
        let regions = regions(&class, blocks, typical_mm, f64::from(edge) * voxel_mm);
        Self {
            edge,
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

/// Largest total coefficient of every material in a row of energies.
fn largest_in_row(attenuation: &Attenuation, row: usize) -> Vec<f32> {
    let first = row * NODES_PER_ROW;
    let nodes = first..=(first + NODES_PER_ROW).min(NODES - 1);
    (0..attenuation.materials())
        .map(|material| attenuation.largest(material, nodes.clone()))
        .collect()
}

/// Bounds in mm⁻¹ per row and class.
fn bounds(members: &[f32], attenuation: &Attenuation) -> Vec<f32> {
    (0..ROWS)
        .into_par_iter()
        .flat_map_iter(|row| {
            let mu = largest_in_row(attenuation, row);
            let classes = members.chunks_exact(mu.len());
            classes
                .map(|densities| strongest(densities, &mu))
                .collect::<Vec<_>>()
        })
        .collect()
}

/// For every block, the cube around it that minimises the expected steps of a photon.
fn regions(class: &[u16], blocks: [usize; 3], typical_mm: &[f32], block_mm: f64) -> Vec<Region> {
    const FARTHEST: u16 = 15;
    // A tentative collision costs about twice as much as crossing a wall.
    let cost_per_mm = |region: &Region| {
        let side_mm = f64::from(2 * u32::from(region.reach) + 1) * block_mm;
        2.0 * f64::from(typical_mm[usize::from(region.class)]) + 2.0 / side_mm
    };
    let mut best: Vec<Region> = class
        .iter()
        .map(|&class| Region { class, reach: 0 })
        .collect();
    // The highest class in the cube around every block, which grows by one block on all sides each time.
    let mut highest = class.to_vec();
    for reach in 1..=FARTHEST {
        let mut stride = 1;
        for count in blocks {
            let before = highest.clone();
            for (block, highest) in highest.iter_mut().enumerate() {
                let at = block / stride % count;
                if at > 0 {
                    *highest = before[block - stride].max(*highest);
                }
                if at + 1 < count {
                    *highest = before[block + stride].max(*highest);
                }
            }
            stride *= count;
        }
        for (best, &class) in best.iter_mut().zip(&highest) {
            let wider = Region { class, reach };
            if cost_per_mm(&wider) < cost_per_mm(best) {
                *best = wider;
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::engine::analog::{self, AnalogSettings};
    use crate::engine::analog_image::ImageSetup;
    use crate::engine::exposure::Exposure;
    use crate::matter::compton::ComptonModel;
    use crate::matter::material::Material;
    use crate::matter::sampler::MaterialTables;
    use crate::transport::block_classes::MOST_CLASSES;
    use crate::transport::tally::Category;
    use crate::transport::voxel_codes::VoxelCode;

    /// Woodcock tracking is correct only if no voxel exceeds the bound of any cube that contains it.
    #[test]
    fn no_voxel_exceeds_the_bound_of_a_cube_around_it() {
        let tables = ["air", "soft_tissue", "bone_cortical", "titanium"].map(|name| {
            MaterialTables::new(&Material::named(name).unwrap(), ComptonModel::default())
        });
        let attenuation = Attenuation::new(&tables);
        let size = [61, 83, 70];
        let coordinates = |n: usize| [n % 61, n / 61 % 83, n / (61 * 83)];
        // Many densities, so that blocks have to share classes.
        let scramble = |n: usize| (n.wrapping_mul(2_654_435_761) >> 7) % 10_007;
        let code = |n: usize| {
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
        };
        let codes = VoxelCodes::from_voxels(size, code);
        for halo in [0, 1] {
            let majorants = Majorants::new(&codes, halo, 1.0, &attenuation);
            assert!((20..=MOST_CLASSES).contains(&majorants.classes));
            let blocks = majorants.blocks.map(|n| n as usize);
            let mut far_reaching = 0;
            for energy_kev in [5.0, 5.03, 33.17, 59.999, 149.99, 150.0] {
                let energy = attenuation.locate(energy_kev);
                let row = majorants.row(energy);
                for voxel in (0..size.iter().product()).step_by(7) {
                    let total = attenuation.at(code(voxel).material(), energy).total;
                    let mu = code(voxel).density_g_cm3() * total;
                    let home = coordinates(voxel);
                    // Every block whose cube contains the voxel.
                    for n in 0..majorants.regions.len() {
                        let at = [
                            n % blocks[0],
                            n / blocks[0] % blocks[1],
                            n / (blocks[0] * blocks[1]),
                        ];
                        let region = majorants.region(n as u32);
                        let reach = usize::from(region.reach);
                        let edge = EDGE as usize;
                        let reaches = (0..3).all(|a| {
                            let first = at[a].saturating_sub(reach) * edge;
                            let end = (at[a] + reach + 1) * edge;
                            (first.saturating_sub(halo)..end + halo).contains(&home[a])
                        });
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
    }

    /// The image of 3e5 histories in blocks of 1, 4 and 64 voxels against blocks of 8: 12 differences of sums beyond 4.5
    /// standard errors raise a false alarm once in 1e4. A bound that is too low by 10 % deviates by 6 or more.
    #[test]
    fn no_expectation_depends_on_the_size_of_the_blocks() {
        let (phantom, spectrum, projection) = crate::engine::small_limb::exposure();
        let model = ComptonModel::default();
        let mut exposure = Exposure::new(&phantom, &spectrum, &projection, model).unwrap();
        let mut image = |edge: u32, seed: u64| {
            let tables = Arc::get_mut(&mut exposure.transport.tables).unwrap();
            let majorants = Majorants::in_blocks(
                edge,
                &tables.codes,
                0,
                phantom.grid().spacing_mm().mean(),
                &tables.attenuation,
            );
            tables.set_majorants(majorants);
            let settings = AnalogSettings {
                histories: 300_000,
                seed,
                ..AnalogSettings::default()
            };
            let tally = analog::run(&exposure, projection.detector.raster(), &settings);
            ImageSetup::new(&exposure).radiograph(&tally, settings.histories, seed)
        };
        let usual = image(EDGE, 1);
        for edge in [1, 4, 64] {
            let other = image(edge, u64::from(edge) + 1);
            for category in Category::ALL {
                let ((a, se_a), (b, se_b)) = (usual.sums.of(category), other.sums.of(category));
                let z = (a - b) / se_a.hypot(se_b);
                println!("edge {edge}, {category:?}: {b:.3} ± {se_b:.3}, z = {z:.1}");
                assert!(z.abs() < 4.5, "edge {edge}, {category:?}: {a} {b}, z = {z}");
            }
        }
    }
}
