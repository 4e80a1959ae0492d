//! Uniform blocks of voxels, such as air around the limb: a path crosses one in a single step.

use rayon::prelude::*;

use crate::transport::voxel_codes::VoxelCode;

/// Voxels along the edge of a block.
pub(super) const EDGE: usize = 16;

/// Blocks of [`EDGE`]³ voxels, and which of them are uniform: of one material and density.
pub(super) struct UniformBlocks {
    /// Blocks along each axis.
    pub size: [usize; 3],
    /// Material and density of every uniform block; x fastest.
    code: Vec<Option<VoxelCode>>,
}

impl UniformBlocks {
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

    /// Material and density of a block, if it is uniform.
    #[inline(always)]
    pub fn code(&self, block: usize) -> Option<VoxelCode> {
        self.code[block]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 20 x 17 x 16 voxels, one of them different: its block is mixed and all others are uniform, including incomplete blocks.
    #[test]
    fn one_different_voxel_makes_its_block_mixed() {
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
            let blocks = UniformBlocks::new(&codes, voxels);
            assert_eq!(blocks.size, [2, 2, 1]);
            for other in 0..4 {
                let expected = if other == block { None } else { Some(air) };
                assert_eq!(blocks.code(other), expected, "{odd:?}, block {other}");
            }
        }
    }
}
