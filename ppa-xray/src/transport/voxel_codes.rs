//! Material and density of a voxel in 32 bits, so that a collision reads one word of memory.

use rayon::prelude::*;

use crate::phantom::voxels::VoxelPhantom;

/// The upper 24 bits of the density as `f32`, accurate to 1.6e-5, with the material index below them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct VoxelCode(u32);

impl VoxelCode {
    #[inline]
    pub fn new(material: u8, density_g_cm3: f32) -> Self {
        // Densities are finite and not negative. Beyond 1e30, attenuation might overflow, and no photon gets in anyway.
        let rounded = density_g_cm3.min(1e30).to_bits() + 0x80;
        Self(rounded & 0xFFFF_FF00 | u32::from(material))
    }

    #[inline]
    pub fn material(self) -> u8 {
        self.0 as u8
    }

    #[inline]
    pub fn density_g_cm3(self) -> f32 {
        f32::from_bits(self.0 & 0xFFFF_FF00)
    }
}

/// Codes of all voxels, and of a rim of one voxel around the box that repeats the outermost ones, so the eight neighbours of any
/// point in the box have a code.
#[derive(Debug)]
pub(crate) struct VoxelCodes {
    /// x fastest; voxel (i, j, k) of the phantom is (i + 1, j + 1, k + 1) here.
    codes: Vec<VoxelCode>,
    /// Voxels along each axis, with the rim.
    size: [usize; 3],
}

impl VoxelCodes {
    pub fn new(phantom: &VoxelPhantom) -> Self {
        let (material, density) = (phantom.material(), phantom.density_g_cm3());
        Self::from_voxels(phantom.grid().size(), |voxel| {
            VoxelCode::new(material[voxel], density[voxel])
        })
    }

    /// Codes by the index of the voxel in a phantom of `voxels` voxels.
    pub fn from_voxels(voxels: [usize; 3], of: impl Fn(usize) -> VoxelCode + Sync) -> Self {
        let size = voxels.map(|count| count + 2);
        // The voxel that is repeated at an index along an axis.
        let inside = |at: usize, axis: usize| at.saturating_sub(1).min(voxels[axis] - 1);
        let mut codes = vec![VoxelCode::default(); size.iter().product()];
        codes
            .par_chunks_exact_mut(size[0])
            .with_min_len(64)
            .enumerate()
            .for_each(|(row, codes)| {
                let (y, z) = (inside(row % size[1], 1), inside(row / size[1], 2));
                let first = voxels[0] * (y + voxels[1] * z);
                for (x, code) in codes.iter_mut().enumerate() {
                    *code = of(first + inside(x, 0));
                }
            });
        Self { codes, size }
    }

    /// Voxels along each axis, with the rim.
    #[inline(always)]
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// Index of a voxel counted from the corner of the rim.
    #[inline(always)]
    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.size[0] * (y + self.size[1] * z)
    }

    /// All codes, x fastest.
    #[inline(always)]
    pub fn all(&self) -> &[VoxelCode] {
        &self.codes
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn codes_keep_the_material_and_the_density(material: u8, density in 1e-6..30.0_f32) {
            let code = VoxelCode::new(material, density);
            prop_assert_eq!(code.material(), material);
            prop_assert!((code.density_g_cm3() / density - 1.0).abs() < 1.6e-5);
        }
    }

    #[test]
    fn extremes_stay_usable() {
        assert_eq!(VoxelCode::new(3, 0.0).density_g_cm3(), 0.0);
        assert!(VoxelCode::new(3, f32::MAX).density_g_cm3() < 1.1e30);
    }

    #[test]
    fn rim_repeats_the_outermost_voxels() {
        let voxels = [3, 1, 2];
        let codes = VoxelCodes::from_voxels(voxels, |voxel| VoxelCode::new(voxel as u8, 1.0));
        assert_eq!(codes.size(), [5, 3, 4]);
        for z in 0..4_usize {
            for y in 0..3 {
                for x in 0..5_usize {
                    let code = codes.all()[codes.index([x, y, z])];
                    let [i, k] = [(x, 2), (z, 1)].map(|(at, last)| at.saturating_sub(1).min(last));
                    assert_eq!(usize::from(code.material()), i + 3 * k, "{x} {y} {z}");
                }
            }
        }
    }
}
