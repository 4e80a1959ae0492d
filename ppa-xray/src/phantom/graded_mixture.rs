//! Gradual mixtures of two materials by density, such as bone between spongy and compact.
//!
//! A voxel of spongy bone contains marrow and thin trabeculae. Treating it as cortical bone of low density would
//! make it far too opaque at diagnostic energies, where the calcium absorbs most, and would create a hard edge where
//! the HU threshold cuts through a gradual transition.

use crate::matter::material::Material;
use crate::matter::material_error::MaterialError;

/// Mass attenuation of neighbouring levels differs by about this factor at [`OPACITY_KEV`], and by less at higher energies.
const LEVEL_RATIO: f64 = 1.05;

/// Energy at which levels are spaced: the softest photons that contribute to a radiograph.
const OPACITY_KEV: f64 = 30.0;

/// Largest number of levels. More would cost memory without benefit: 64 span a factor of 20.
const MOST_LEVELS: f64 = 64.0;

/// Two materials in the same voxel, in levels from nearly the first to nearly the second.
///
/// Densities mix by volume: ρ = (1 − v) ρ₀ + v ρ₁, where ρ₀ and ρ₁ are the densities of voxels of one material;
/// the mass fraction of the second is w = v ρ₁ / ρ.
pub(crate) struct GradedMixture {
    pub levels: Vec<Material>,
    /// Density at which each level ends and the next begins; one less than there are levels.
    bounds_g_cm3: Vec<f32>,
}

impl GradedMixture {
    /// Builds levels named `name` between two materials, with the densities of voxels that they fill.
    pub fn new(
        name: &str,
        materials: [&Material; 2],
        density_g_cm3: [f32; 2],
    ) -> Result<Self, MaterialError> {
        let [first, second] = materials;
        let opacity = second.total_cm2_g(OPACITY_KEV)? / first.total_cm2_g(OPACITY_KEV)?;
        let count = (opacity.ln().abs() / LEVEL_RATIO.ln())
            .round()
            .clamp(1.0, MOST_LEVELS);
        // Spaced so that the opacity increases by the same factor from level to level.
        let mass_share = |step: f64| {
            let share = step / count;
            if (opacity - 1.0).abs() < 1e-3 {
                share
            } else {
                (opacity.powf(share) - 1.0) / (opacity - 1.0)
            }
        };
        let density = |mass_share: f64| {
            let [low, high] = density_g_cm3.map(f64::from);
            1.0 / ((1.0 - mass_share) / low + mass_share / high)
        };
        let level = |level: usize| {
            let share = mass_share(level as f64 + 0.5);
            Material::mixture(
                format!("{name}, {:.0} % {} by mass", 100.0 * share, second.name()),
                density(share),
                &[(first, 1.0 - share), (second, share)],
            )
        };
        Ok(Self {
            levels: (0..count as usize).map(level).collect::<Result<_, _>>()?,
            bounds_g_cm3: (1..count as usize)
                .map(|bound| density(mass_share(bound as f64)) as f32)
                .collect(),
        })
    }

    /// Level of a voxel of this density; voxels denser than the second material are in the last level.
    pub fn level(&self, density_g_cm3: f32) -> usize {
        self.bounds_g_cm3
            .partition_point(|&bound| bound <= density_g_cm3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bone() -> GradedMixture {
        let [soft, cortical] =
            ["soft_tissue", "bone_cortical"].map(|name| Material::named(name).unwrap());
        GradedMixture::new("bone", [&soft, &cortical], [1.076_2, 1.85]).unwrap()
    }

    #[test]
    fn neighbouring_levels_differ_little_and_rise() {
        let bone = bone();
        assert!((20..30).contains(&bone.levels.len()));
        for pair in bone.levels.windows(2) {
            let [low, high] = [&pair[0], &pair[1]].map(|m| m.total_cm2_g(30.0).unwrap());
            assert!(
                (1.0..1.08).contains(&(high / low)),
                "{} {}",
                pair[0].name(),
                high / low
            );
        }
    }

    /// A half-and-half mixture by volume is in the level with the corresponding mass share: w = v ρ₁ / ρ.
    #[test]
    fn a_density_gets_the_level_of_its_mass_share() {
        let bone = bone();
        for volume in [0.1, 0.5, 0.9] {
            let density = (1.0 - volume) * 1.076_2 + volume * 1.85;
            let mass_share = volume * 1.85 / density;
            let level = &bone.levels[bone.level(density as f32)];
            let calcium = level.mass_fractions().iter().find(|(z, _)| *z == 20);
            // Cortical bone is 20.993 % calcium, soft tissue 0.023 %; a level spans up to 0.08 of mass share.
            let found = (calcium.unwrap().1 - 0.000_23) / (0.209_93 - 0.000_23);
            assert!((found - mass_share).abs() < 0.05, "{found} {mass_share}");
        }
        assert_eq!(bone.level(0.5), 0);
        assert_eq!(bone.level(3.0), bone.levels.len() - 1);
    }
}
