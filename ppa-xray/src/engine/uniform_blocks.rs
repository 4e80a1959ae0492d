//! Uniform blocks of cells, such as air around the limb, which a path crosses in a single step.

use rayon::prelude::*;

use crate::transport::voxel_codes::{VoxelCode, VoxelCodes};

/// Cells along the edge of a block.
pub(super) const EDGE: usize = 16;

/// Density up to which a block counts as air, g/cm³.
const AIR_G_CM3: f32 = 2e-3;

/// Blocks of [`EDGE`]³ cells, and which of them are uniform in material and density.
pub(super) struct UniformBlocks {
    /// Blocks along each axis.
    pub size: [usize; 3],
    /// Material and density of every uniform block; x fastest.
    code: Vec<Option<VoxelCode>>,
}

impl UniformBlocks {
    /// Builds blocks of cells, each of which depends on the voxel of the same index and on `halo` voxels after that along each axis.
    pub fn new(codes: &VoxelCodes, halo: usize) -> Self {
        let voxels = codes.size();
        let size = voxels.map(|count| count.div_ceil(EDGE));
        let range =
            |block: usize, axis: usize| block * EDGE..((block + 1) * EDGE + halo).min(voxels[axis]);
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
                    .flat_map(|k| range(at[1], 1).map(move |j| codes.index([0, j, k])))
                    .map(|row| &codes.all()[row + x.start..row + x.end]);
                let first = codes.all()[codes.index(at.map(|block| block * EDGE))];
                rows.all(|row| row.iter().all(|code| *code == first))
                    .then_some(first)
            })
            .collect();
        Self { size, code }
    }

    /// Blocks of which none is uniform.
    #[cfg(test)]
    pub fn mixed(size: [usize; 3]) -> Self {
        Self {
            size,
            code: vec![None; size.iter().product()],
        }
    }

    /// The first cell of every block that is not uniform air.
    pub fn denser_than_air(&self) -> impl Iterator<Item = [usize; 3]> {
        let size = self.size;
        let is_air = |code: VoxelCode| code.density_g_cm3() <= AIR_G_CM3;
        let blocks = self.code.iter().enumerate();
        blocks
            .filter(move |(_, code)| !code.is_some_and(is_air))
            .map(move |(block, _)| {
                let layer = block / size[0];
                [block % size[0], layer % size[1], layer / size[1]].map(|at| at * EDGE)
            })
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

    /// 18 x 15 x 14 voxels, which are 20 x 17 x 16 with the rim, one of them different: the blocks that contain it are mixed, and with a
    /// halo those before them; all others are uniform, including incomplete blocks.
    #[test]
    fn one_different_voxel_makes_its_block_mixed() {
        let voxels = [18, 15, 14];
        let (air, bone) = (VoxelCode::new(0, 1.2e-3), VoxelCode::new(3, 1.9));
        for (odd, halo, mixed) in [
            ([3, 4, 5], 0, vec![0]),
            ([17, 13, 13], 0, vec![1]),
            ([0, 14, 0], 0, vec![0, 2]), // the rim repeats it
            ([15, 14, 6], 0, vec![1, 3]),
            ([15, 4, 6], 1, vec![0, 1]),
            ([16, 4, 6], 1, vec![1]),
        ] {
            let index = odd[0] + voxels[0] * (odd[1] + voxels[1] * odd[2]);
            let codes =
                VoxelCodes::from_voxels(voxels, |voxel| if voxel == index { bone } else { air });
            let blocks = UniformBlocks::new(&codes, halo);
            assert_eq!(blocks.size, [2, 2, 1]);
            for block in 0..4 {
                let expected = (!mixed.contains(&block)).then_some(air);
                assert_eq!(blocks.code(block), expected, "{odd:?}, block {block}");
            }
        }
    }
}
