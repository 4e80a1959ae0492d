//! Material and density of a voxel in 32 bits, so that a collision reads one word of memory.

use rayon::prelude::*;

use crate::phantom::voxels::VoxelPhantom;

/// The upper 24 bits of the density as `f32`, within 1.6e-5 of it, and the material index below them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct VoxelCode(u32);

impl VoxelCode {
    #[inline]
    pub fn new(material: u8, density_g_cm3: f32) -> Self {
        // Densities are finite and not negative; beyond 1e30, attenuation might overflow, and no photon gets in anyway.
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

/// Codes of all voxels, in the order of the phantom.
pub(crate) fn voxel_codes(phantom: &VoxelPhantom) -> Vec<VoxelCode> {
    phantom
        .material()
        .par_iter()
        .zip(phantom.density_g_cm3())
        .with_min_len(1 << 16)
        .map(|(&material, &density)| VoxelCode::new(material, density))
        .collect()
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
}
