//! Classification of blocks of voxels by opacity.

use rayon::prelude::*;

use crate::transport::voxel_codes::VoxelCodes;

/// Largest number of classes.
pub(super) const MOST_CLASSES: usize = 64;

/// Lower limit of the bounds, so that the free path does not overflow; mm⁻¹.
const VACUUM: f32 = 1e-12;

/// Largest density of every material in every block and the `halo` voxels around it, g/cm³.
pub(super) fn densest_per_block(
    codes: &VoxelCodes,
    halo: usize,
    (edge, blocks): (usize, [usize; 3]),
    materials: usize,
) -> Vec<f32> {
    // Positions in the codes; the rim takes the first.
    let places = |block: usize, axis: usize| {
        let first = 1 + block * edge;
        first - halo..(first + edge + halo).min(codes.size()[axis] - 1 + halo)
    };
    let mut densest = vec![0.0_f32; blocks.iter().product::<usize>() * materials];
    densest
        .par_chunks_exact_mut(blocks[0] * materials)
        .enumerate()
        .for_each(|(row, densest)| {
            for z in places(row / blocks[1], 2) {
                for y in places(row % blocks[1], 1) {
                    let line = &codes.all()[codes.index([0, y, z])..][..codes.size()[0]];
                    for (i, block) in densest.chunks_exact_mut(materials).enumerate() {
                        for code in &line[places(i, 0)] {
                            let largest = &mut block[usize::from(code.material())];
                            *largest = largest.max(code.density_g_cm3());
                        }
                    }
                }
            }
        });
    densest
}

/// Class of every block, and the largest density per material of every class and those below it.
///
/// Classes follow the attenuation at the typical energy, `mu` per density and material. If there are too many different values,
/// they are truncated to fewer digits.
pub(super) fn classify(densest: &[f32], mu: &[f32]) -> (Vec<u16>, Vec<f32>) {
    let materials = mu.len();
    let opacity: Vec<u32> = densest
        .par_chunks_exact(materials)
        .with_min_len(1024)
        .map(|densities| strongest(densities, mu).to_bits()) // ordered as the numbers are
        .collect();
    let mut known = opacity.clone();
    known.sort_unstable();
    known.dedup();
    let mut digits_off = 0;
    while known.len() > MOST_CLASSES {
        digits_off += 1;
        known.iter_mut().for_each(|bits| *bits >>= 1);
        known.dedup();
    }
    let class: Vec<u16> = opacity
        .iter()
        .map(|bits| known.partition_point(|&other| other < bits >> digits_off) as u16)
        .collect();
    let mut members = vec![0.0_f32; known.len() * materials];
    for (&class, densities) in class.iter().zip(densest.chunks_exact(materials)) {
        let row = &mut members[usize::from(class) * materials..][..materials];
        for (largest, &density) in row.iter_mut().zip(densities) {
            *largest = largest.max(density);
        }
    }
    for at in materials..members.len() {
        members[at] = members[at].max(members[at - materials]);
    }
    (class, members)
}

/// Largest attenuation among materials of the given densities, mm⁻¹.
pub(super) fn strongest(densities: &[f32], mu: &[f32]) -> f32 {
    densities
        .iter()
        .zip(mu)
        .map(|(density, mu)| density * mu)
        .fold(VACUUM, f32::max)
}
