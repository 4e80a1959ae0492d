//! Coherent scattering of a material that contains substances with measured form factors.

use crate::{
    matter::composition::Composition,
    matter::cross_sections::{CrossSections, HC_KEV_ANGSTROM},
    matter::energy_nodes::energy_nodes,
    matter::energy_range::MAX_ENERGY_KEV,
    matter::molecular_form_factors::{LAST_Q, Measured},
    matter::thomson::ThomsonIntegral,
    octaves::Octaves,
};

/// Bins per octave of x = q², as a power of two, and smallest x in 1/Å²: the nodes of the samplers.
const Q_SQUARED_BITS: u32 = 5;
const MIN_Q_SQUARED: f64 = 1e-5;

/// q in 1/Å above which the substance scatters like free atoms; between the measured values and this q, F is linear.
const ATOMS_FROM_Q: f64 = 1.0;

/// A share of a material's mass, and the measurement that describes it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Part {
    /// Share of the mass.
    pub share: f64,
    pub composition: Composition,
    pub measured: Option<Measured>,
}

impl Part {
    /// F² per gram, up to the constant of [`Composition::form_factor_squared`], which is mol.
    fn form_factor_squared(&self, q: f64) -> f64 {
        let Some(measured) = self.measured.filter(|_| q < ATOMS_FROM_Q) else {
            return self.composition.form_factor_squared(q);
        };
        if q <= LAST_Q {
            return measured.squared_per_gram(q);
        }
        let [low, high] = [
            measured.squared_per_gram(LAST_Q),
            self.composition.form_factor_squared(ATOMS_FROM_Q),
        ]
        .map(f64::sqrt);
        let t = (q - LAST_Q) / (ATOMS_FROM_Q - LAST_Q);
        (low + t * (high - low)).powi(2)
    }
}

/// Form factor and cross section of all parts of a material together.
///
/// Intensities of the parts add up. The cross section of a measured part is the integral of Thomson's law times F²; that of the
/// rest is the tabulated one of its elements.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MolecularScatter {
    parts: Vec<Part>,
    measured: ThomsonIntegral,
}

impl MolecularScatter {
    pub(crate) fn new(parts: &[Part]) -> Self {
        let largest = (MAX_ENERGY_KEV / HC_KEV_ANGSTROM).powi(2);
        let grid = Octaves::covering(MIN_Q_SQUARED, largest, Q_SQUARED_BITS);
        let x: Vec<f64> = std::iter::once(0.0).chain(grid.nodes()).collect();
        let measured = || parts.iter().filter(|part| part.measured.is_some());
        let squared = x
            .iter()
            .map(|x| {
                measured()
                    .map(|part| part.share * part.form_factor_squared(x.sqrt()))
                    .sum()
            })
            .collect();
        Self {
            parts: parts.to_vec(),
            measured: ThomsonIntegral::new(x, squared),
        }
    }

    /// Σ share · F² per gram at q in 1/Å.
    pub(crate) fn form_factor_squared(&self, q: f64) -> f64 {
        self.parts
            .iter()
            .map(|part| part.share * part.form_factor_squared(q))
            .sum()
    }

    /// Rayleigh scattering in cm²/g.
    pub(crate) fn rayleigh_cm2_g(&self, energy_kev: f64) -> f64 {
        let atoms: f64 = self
            .atoms()
            .map(|part| part.share * part.composition.cross_sections(energy_kev).rayleigh)
            .sum();
        atoms + self.measured_cm2_g(energy_kev)
    }

    /// Writes [`MolecularScatter::rayleigh_cm2_g`] into cross sections at [`energy_nodes`].
    pub(crate) fn replace_at_nodes(&self, sections: &mut [CrossSections]) {
        for (section, energy_kev) in sections.iter_mut().zip(energy_nodes()) {
            section.rayleigh = self.measured_cm2_g(energy_kev);
        }
        for part in self.atoms() {
            let of_part = part.composition.cross_sections_at_nodes();
            for (section, of_part) in sections.iter_mut().zip(of_part) {
                section.rayleigh += part.share * of_part.rayleigh;
            }
        }
    }

    fn atoms(&self) -> impl Iterator<Item = &Part> {
        self.parts.iter().filter(|part| part.measured.is_none())
    }

    fn measured_cm2_g(&self, energy_kev: f64) -> f64 {
        self.measured.cm2_g((energy_kev / HC_KEV_ANGSTROM).powi(2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matter::form_factors::FormFactors;
    use crate::matter::material::Material;

    fn molecular(name: &str) -> Material {
        Material::named(name)
            .unwrap()
            .with_form_factors(FormFactors::Molecular)
    }

    /// Steps of 1e-4 in sin(θ/2) over the form factor itself, not over the grid of its moments.
    #[test]
    fn rayleigh_is_the_integral_of_the_form_factor() {
        const THOMSON_CM2_MOL: f64 = 0.079_407_877 * 0.602_214_076; // rₑ² in barn × N_A × 1e-24
        for name in ["water", "muscle", "adipose", "soft_tissue", "pmma"] {
            let material = molecular(name);
            for energy_kev in [6.0, 20.0, 33.0, 60.0, 150.0] {
                let steps = 10_000;
                let integral: f64 = (0..steps)
                    .map(|i| {
                        let s = (f64::from(i) + 0.5) / f64::from(steps);
                        let cos = 1.0 - 2.0 * s * s;
                        let q = s * energy_kev / HC_KEV_ANGSTROM;
                        let squared = material.form_factor_squared_per_gram(q);
                        // dΩ = 8π s ds
                        4.0 * std::f64::consts::PI * s * (1.0 + cos * cos) * squared
                    })
                    .sum();
                let expected = THOMSON_CM2_MOL * integral / f64::from(steps);
                let found = material.rayleigh_cm2_g(energy_kev).unwrap();
                assert!(
                    (found / expected - 1.0).abs() < 1e-3,
                    "{name} at {energy_kev} keV: {found} {expected}"
                );
            }
        }
    }

    /// The published F/√M of water at its peak, and F² where the measurement joins the free atoms.
    #[test]
    fn form_factors_are_the_published_ones_and_join_the_atoms() {
        let water = molecular("water");
        let atoms = Material::named("water").unwrap();
        let at = |q| water.form_factor_squared_per_gram(q);
        assert!((at(0.16) - 1.876_f64.powi(2)).abs() < 1e-12);
        assert!((at(0.235) - 1.478_25_f64.powi(2)).abs() < 1e-12);
        for q in [0.9, 1.0] {
            assert!((at(q - 1e-9) / at(q + 1e-9) - 1.0).abs() < 1e-6, "{q}");
        }
        assert_eq!(at(2.0), atoms.form_factor_squared_per_gram(2.0));
        // At q = 0, thermal fluctuations of density: n kT κ Z²/M with n = 33.4/nm³, kT = 4.05e-21 J, κ = 4.59e-10/Pa.
        let expected = 33.4e27 * 4.05e-21 * 4.59e-10 * 100.0 / 18.015;
        assert!((at(0.0) / expected - 1.0).abs() < 0.02, "{expected}");
    }

    #[test]
    fn parts_of_a_mixture_add_up_by_mass() {
        let [water, bone] = ["water", "bone_cortical"].map(|name| Material::named(name).unwrap());
        let parts = [(&water, 0.3), (&bone, 0.7)];
        let mixture = Material::mixture("mixture", 1.5, &parts).unwrap();
        assert_eq!(mixture.form_factors(), FormFactors::IndependentAtoms);
        let mixture = mixture.with_form_factors(FormFactors::Molecular);
        let water = water.with_form_factors(FormFactors::Molecular);
        for energy_kev in [10.0, 40.0] {
            let [mixed, water, bone] = [&mixture, &water, &bone]
                .map(|material| material.rayleigh_cm2_g(energy_kev).unwrap());
            assert!((mixed / (0.3 * water + 0.7 * bone) - 1.0).abs() < 1e-12);
        }
        let [mixed, water, bone] =
            [&mixture, &water, &bone].map(|material| material.form_factor_squared_per_gram(0.16));
        assert!((mixed / (0.3 * water + 0.7 * bone) - 1.0).abs() < 1e-12);
        // A mixture selects the form factors of its parts, and the selection can be undone.
        let water = molecular("water");
        let again = Material::mixture("mixture", 1.5, &[(&water, 0.3), (&bone_cortical(), 0.7)]);
        assert_eq!(again.unwrap(), mixture);
        let atoms = mixture.with_form_factors(FormFactors::IndependentAtoms);
        assert_eq!(atoms.form_factors(), FormFactors::IndependentAtoms);
    }

    fn bone_cortical() -> Material {
        Material::named("bone_cortical").unwrap()
    }

    #[test]
    fn nodes_of_the_tables_hold_the_same_cross_sections() {
        let [water, bone] = [molecular("water"), bone_cortical()];
        let mixture = Material::mixture("mixture", 1.5, &[(&water, 0.3), (&bone, 0.7)]).unwrap();
        let nodes = mixture.cross_sections_at_nodes();
        for (section, energy_kev) in nodes.iter().zip(energy_nodes()).step_by(101) {
            let expected = mixture.cross_sections_unchecked(energy_kev);
            assert!((section.total() / expected.total() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn materials_without_a_measurement_stay_as_they_are() {
        for name in ["bone_cortical", "titanium", "air"] {
            let material = Material::named(name).unwrap();
            assert_eq!(molecular(name), material);
        }
    }
}
