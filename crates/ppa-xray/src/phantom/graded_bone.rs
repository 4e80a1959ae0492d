//! Bone between spongy and compact: soft tissue and cortical bone mixed by density.
//!
//! A voxel of spongy bone holds marrow and thin trabeculae. Taking it for cortical bone of low density would
//! make it far too opaque at diagnostic energies, where the calcium absorbs most, and would draw a hard edge where
//! the HU threshold cuts through a gradual transition.

use crate::matter::material::Material;
use crate::matter::material_error::MaterialError;
use crate::phantom::hu::HuCalibration;

/// Mixtures from soft tissue to cortical bone.
const LEVELS: usize = 24;

/// How many times as opaque as soft tissue a gram of cortical bone is at 30 keV. The levels are spaced so that
/// neighbours differ by the same factor there, about 5 %; at higher energies by less.
const OPACITY: f64 = 3.3;

/// Soft tissue and cortical bone side by side in a voxel.
///
/// Densities mix by volume: ρ = (1 − v) ρ₀ + v ρ₁, with ρ₀ where the calibration's bone begins and ρ₁ that of
/// cortical bone; w = v ρ₁ / ρ of the mass is cortical bone.
pub(crate) struct GradedBone {
    soft_g_cm3: f64,
    cortical: Material,
}

impl GradedBone {
    pub fn new(calibration: &HuCalibration) -> Result<Self, MaterialError> {
        Ok(Self {
            soft_g_cm3: f64::from(calibration.density_g_cm3(calibration.bone_from_hu)),
            cortical: Material::named("bone_cortical")?,
        })
    }

    /// The mixtures, from nearly soft tissue to nearly cortical bone.
    pub fn materials(&self, soft_tissue: &Material) -> Result<Vec<Material>, MaterialError> {
        let mixture = |level| {
            let share = (level as f64 + 0.5) / LEVELS as f64;
            let cortical = (OPACITY.powf(share) - 1.0) / (OPACITY - 1.0);
            let specific_volume =
                (1.0 - cortical) / self.soft_g_cm3 + cortical / self.cortical.density_g_cm3();
            Material::mixture(
                format!("bone, {:.0} % cortical by mass", 100.0 * cortical),
                1.0 / specific_volume,
                &[(soft_tissue, 1.0 - cortical), (&self.cortical, cortical)],
            )
        };
        (0..LEVELS).map(mixture).collect()
    }

    /// Which mixture a bone voxel of this density is; denser than cortical is the last.
    pub fn level(&self, density_g_cm3: f32) -> usize {
        let (density, cortical_g_cm3) = (f64::from(density_g_cm3), self.cortical.density_g_cm3());
        if density >= cortical_g_cm3 {
            return LEVELS - 1;
        }
        let volume = (density - self.soft_g_cm3) / (cortical_g_cm3 - self.soft_g_cm3);
        let cortical = (volume * cortical_g_cm3 / density).clamp(0.0, 1.0);
        let share = (1.0 + (OPACITY - 1.0) * cortical).ln() / OPACITY.ln();
        ((share * LEVELS as f64) as usize).min(LEVELS - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attenuation_mm(hu: f32, energy_kev: f64) -> f64 {
        let calibration = HuCalibration::default();
        let bone = GradedBone::new(&calibration).unwrap();
        let materials = bone
            .materials(&Material::named("soft_tissue").unwrap())
            .unwrap();
        let density = calibration.density_g_cm3(hu);
        let material = &materials[bone.level(density)];
        material.total_cm2_g(energy_kev).unwrap() * f64::from(density) / 10.0
    }

    /// HU are attenuation relative to water at the scanner's mean energy, about 70 keV at 120 kV: the calibration
    /// must give them back. 5 % covers the levels and the spread of scanners.
    #[test]
    fn attenuation_at_ct_energies_is_what_the_hu_say() {
        let water_mm = Material::named("water").unwrap().total_cm2_g(70.0).unwrap() / 10.0;
        for hu in [120.0, 200.0, 300.0, 500.0, 800.0, 1_200.0, 1_400.0] {
            let expected = water_mm * (1.0 + f64::from(hu) / 1_000.0);
            let ratio = attenuation_mm(hu, 70.0) / expected;
            assert!((ratio - 1.0).abs() < 0.05, "{hu} HU: {ratio:.3}");
        }
    }

    /// No hard edge where bone begins: from soft tissue at the threshold to the first mixture.
    #[test]
    fn bone_begins_without_a_step() {
        let calibration = HuCalibration::default();
        let hu = calibration.bone_from_hu;
        let soft = Material::named("soft_tissue").unwrap();
        let before =
            soft.total_cm2_g(36.0).unwrap() * f64::from(calibration.density_g_cm3(hu - 1.0)) / 10.0;
        let step = attenuation_mm(hu + 1.0, 36.0) / before - 1.0;
        assert!(
            (0.0..0.08).contains(&step),
            "a step of {:.1} %",
            100.0 * step
        );
    }

    #[test]
    fn neighbouring_levels_differ_little_and_rise() {
        let bone = GradedBone::new(&HuCalibration::default()).unwrap();
        let materials = bone
            .materials(&Material::named("soft_tissue").unwrap())
            .unwrap();
        for pair in materials.windows(2) {
            let [low, high] = [&pair[0], &pair[1]].map(|m| m.total_cm2_g(30.0).unwrap());
            assert!(
                (1.0..1.08).contains(&(high / low)),
                "{} {}",
                pair[0].name(),
                high / low
            );
        }
    }
}
