//! Blocks of voxels that all hold the same, such as air around the limb: a path crosses one in a single step.

use rayon::prelude::*;

use crate::transport::voxel_codes::VoxelCode;

/// Voxels along the edge of a block.
pub(super) const EDGE: usize = 16;

/// Which blocks are even.
pub(super) struct EvenBlocks {
    /// Blocks along each axis.
    pub size: [usize; 3],
    /// The voxel that all others of the block are like; x fastest.
    code: Vec<Option<VoxelCode>>,
}

impl EvenBlocks {
    pub fn new(codes: &[VoxelCode], voxels: [usize; 3]) -> Self {
        let size = voxels.map(|count| count.div_ceil(EDGE));
        let range =
            |block: usize, axis: usize| block * EDGE..((block + 1) * EDGE).min(voxels[axis]);
        let code = (0..size.iter().product())
            .into_par_iter()
            .map(|block| {
                let at = [
                    block % size[0],
                    block / size[0] % size[1],
                    block / (size[0] * size[1]),
                ];
                let x = range(at[0], 0);
                let mut rows = range(at[2], 2)
                    .flat_map(|k| range(at[1], 1).map(move |j| voxels[0] * (j + voxels[1] * k)))
                    .map(|row| &codes[row + x.start..row + x.end]);
                let first = codes[x.start + voxels[0] * (at[1] * EDGE + voxels[1] * at[2] * EDGE)];
                rows.all(|row| row.iter().all(|code| *code == first))
                    .then_some(first)
            })
            .collect();
        Self { size, code }
    }

    /// What all voxels of a block hold, if it is the same.
    #[inline(always)]
    pub fn code(&self, block: usize) -> Option<VoxelCode> {
        self.code[block]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 20 x 17 x 16 voxels, of which one is different: its block, and no other, is uneven, also where blocks are cut off.
    #[test]
    fn one_voxel_makes_its_block_uneven() {
        let voxels = [20, 17, 16];
        let (air, bone) = (VoxelCode::new(0, 1.2e-3), VoxelCode::new(3, 1.9));
        for (odd, block) in [
            ([3, 4, 5], 0),
            ([19, 15, 15], 1),
            ([0, 16, 0], 2),
            ([16, 16, 7], 3),
        ] {
            let mut codes = vec![air; voxels.iter().product()];
            codes[odd[0] + voxels[0] * (odd[1] + voxels[1] * odd[2])] = bone;
            let blocks = EvenBlocks::new(&codes, voxels);
            assert_eq!(blocks.size, [2, 2, 1]);
            for other in 0..4 {
                let expected = if other == block { None } else { Some(air) };
                assert_eq!(blocks.code(other), expected, "{odd:?}, block {other}");
            }
        }
    }
}
