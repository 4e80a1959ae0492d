//! One material prepared for transport: cross sections evaluated without logarithms, and the scattering samplers.

use ppa_core::random::Philox;

use crate::{
    matter::compton::{Compton, ComptonModel},
    matter::cross_section_table::CrossSectionTable,
    matter::cross_sections::{CrossSections, HC_KEV_ANGSTROM},
    matter::energy_range::CUTOFF_KEV,
    matter::energy_range::{MAX_ENERGY_KEV, MIN_ENERGY_KEV},
    matter::fluorescence::Fluorescence,
    matter::impulse_approximation::BoundElectron,
    matter::material::Material,
    matter::rayleigh::Rayleigh,
    octaves::Octaves,
};

/// Bins per octave of q², as a power of two.
const Q_SQUARED_BITS: u32 = 5;
/// Smallest q² node in 1/Å²: below it F² and S are linear in q².
const MIN_Q_SQUARED: f64 = 1e-5;

/// Cross sections and samplers of one material for photons of 1 to 150 keV.
#[derive(Clone, Debug)]
pub struct MaterialTables {
    material: Material,
    cross_sections: CrossSectionTable,
    rayleigh: Rayleigh,
    compton: Compton,
    fluorescence: Fluorescence,
}

/// Angle and energy of a Compton scattering.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ComptonScattering {
    /// sin²(θ/2) of the scattering angle θ.
    pub sin2_half_theta: f64,
    /// Energy of the scattered photon, keV.
    pub energy_kev: f64,
}

impl ComptonScattering {
    /// Cosine of the scattering angle.
    #[inline]
    #[must_use]
    pub fn cos_theta(&self) -> f64 {
        1.0 - 2.0 * self.sin2_half_theta
    }
}

impl MaterialTables {
    /// Prepares a material for Compton scattering by `model`.
    #[must_use]
    pub fn new(material: &Material, model: ComptonModel) -> Self {
        let q_squared = Octaves::covering(
            MIN_Q_SQUARED,
            (MAX_ENERGY_KEV / HC_KEV_ANGSTROM).powi(2),
            Q_SQUARED_BITS,
        );
        Self {
            cross_sections: CrossSectionTable::new(material),
            rayleigh: Rayleigh::new(material),
            compton: Compton::new(material, model, q_squared),
            fluorescence: Fluorescence::new(material, CUTOFF_KEV),
            material: material.clone(),
        }
    }

    /// The material that was prepared.
    #[must_use]
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// Mass attenuation by interaction in cm²/g, within 0.1 % of [`Material::cross_sections`].
    ///
    /// Energies outside 1 to 150 keV get the values at the nearer end.
    #[inline]
    #[must_use]
    pub fn cross_sections(&self, energy_kev: f64) -> CrossSections {
        self.cross_sections
            .at(energy_kev)
            .unwrap_or_else(|| self.asked(energy_kev))
    }

    #[cold]
    fn asked(&self, energy_kev: f64) -> CrossSections {
        self.material
            .cross_sections_unchecked(energy_kev.clamp(MIN_ENERGY_KEV, MAX_ENERGY_KEV))
    }

    /// Samples sin²(θ/2) of a Rayleigh scattering angle; `uniform` returns random numbers in [0, 1).
    #[inline]
    pub fn rayleigh_sin2_half_theta(
        &self,
        energy_kev: f64,
        mut uniform: impl FnMut() -> f64,
    ) -> f64 {
        let sin2_half_theta = self.rayleigh.sample(energy_kev as f32, || uniform() as f32);
        f64::from(sin2_half_theta)
    }

    /// Samples a Compton scattering; `uniform` returns random numbers in [0, 1).
    #[inline]
    pub fn compton_scattering(
        &self,
        energy_kev: f64,
        mut uniform: impl FnMut() -> f64,
    ) -> ComptonScattering {
        let (sin2_half_theta, scattered_kev) =
            self.compton.sample(energy_kev as f32, || uniform() as f32);
        ComptonScattering {
            sin2_half_theta: f64::from(sin2_half_theta),
            energy_kev: f64::from(scattered_kev).min(energy_kev),
        }
    }

    /// Energy in keV of the K photon above 5 keV that follows photoelectric absorption, if any; it is emitted isotropically.
    /// `u` is uniform in [0, 1). Materials made from tables emit none.
    #[inline]
    #[must_use]
    pub fn k_fluorescence(&self, energy_kev: f64, u: f64) -> Option<f64> {
        self.fluorescence.sample(energy_kev, u)
    }

    /// Energies in keV of the K photons above 5 keV that may follow photoelectric absorption, with their probabilities.
    pub(crate) fn k_lines(&self, energy_kev: f64) -> impl Iterator<Item = (f64, f64)> {
        self.fluorescence.lines(energy_kev)
    }

    /// Samples the energy in keV of a photon that was Compton scattered by θ; `uniform` returns random numbers in [0, 1).
    #[inline]
    pub fn compton_energy_at(
        &self,
        energy_kev: f64,
        cos_theta: f64,
        mut uniform: impl FnMut() -> f64,
    ) -> f64 {
        let sin2_half_theta = (0.5 * (1.0 - cos_theta)) as f32;
        let sampled = self
            .compton
            .sample_energy(energy_kev as f32, sin2_half_theta, || uniform() as f32);
        f64::from(sampled).min(energy_kev)
    }

    /// Samples sin²(θ/2) and the electron of one attempt at Compton scattering in the impulse approximation; `None` for
    /// other models.
    #[inline(always)]
    pub(crate) fn attempt_compton(
        &self,
        energy_kev: f32,
        u_angle: f32,
        u_shell: f32,
    ) -> Option<(f32, BoundElectron)> {
        match &self.compton {
            Compton::ImpulseApproximation(impulse) => {
                Some(impulse.attempt(energy_kev, u_angle, u_shell))
            }
            Compton::IncoherentFunction(_) => None,
        }
    }

    /// Samples the cosine of a Rayleigh scattering angle.
    #[inline]
    pub(crate) fn sample_rayleigh(&self, energy_kev: f64, random: &mut Philox) -> f64 {
        1.0 - 2.0 * self.rayleigh_sin2_half_theta(energy_kev, || random.unit())
    }

    /// Samples the cosine of a Compton scattering angle and the energy of the scattered photon in keV.
    #[inline]
    pub(crate) fn sample_compton(&self, energy_kev: f64, random: &mut Philox) -> (f64, f64) {
        let scattering = self.compton_scattering(energy_kev, || random.unit());
        (scattering.cos_theta(), scattering.energy_kev)
    }
}

#[cfg(test)]
mod tests {
    use std::{fs, path::PathBuf};

    use super::*;
    use crate::matter::cross_sections::ELECTRON_REST_KEV;
    use crate::matter::electron_shell::{ATOMIC_MOMENTA_PER_MC, Shell};
    use crate::matter::impulse_approximation::electrons_freed;
    use crate::matter::klein_nishina::differential;

    const SAMPLES: u64 = 200_000;

    /// Sums of a sampled quantity.
    #[derive(Default)]
    struct Moment {
        sum: f64,
        squares: f64,
    }

    impl Moment {
        fn add(&mut self, value: f64) {
            self.sum += value;
            self.squares += value * value;
        }

        /// Difference between the mean and `expected` in units of the standard error.
        fn z(&self, expected: f64) -> f64 {
            let n = SAMPLES as f64;
            let mean = self.sum / n;
            (mean - expected) / ((self.squares / n - mean * mean) / n).sqrt()
        }
    }

    /// Samples ⟨cos⟩, ⟨cos²⟩ of Rayleigh and ⟨cos⟩, ⟨cos²⟩, ⟨E′⟩ of Compton scattering.
    fn moments(material: &Material, model: ComptonModel, energy_kev: f64) -> [Moment; 5] {
        let tables = MaterialTables::new(material, model);
        let mut moments: [Moment; 5] = Default::default();
        for index in 0..SAMPLES {
            let mut random = Philox::new(2026, 0, index);
            let cos = tables.sample_rayleigh(energy_kev, &mut random);
            assert!((-1.0..=1.0).contains(&cos));
            moments[0].add(cos);
            moments[1].add(cos * cos);
            let (cos, scattered_kev) = tables.sample_compton(energy_kev, &mut random);
            assert!((-1.0..=1.0).contains(&cos) && scattered_kev <= energy_kev);
            moments[2].add(cos);
            moments[3].add(cos * cos);
            moments[4].add(scattered_kev);
        }
        moments
    }

    /// Mean of E′/E′(electron at rest) over the shells' truncated profiles at an angle, by the midpoint rule in p.
    ///
    /// E′ from its defining equation, p = (E E′(1 − cos θ) − mc²(E − E′)) / (c q), by bisection instead of the sampler's
    /// closed form; F as in the sampler.
    fn mean_shift(shells: &[Shell], energy_kev: f64, sin2_half_theta: f64, steps: u32) -> f64 {
        let (m, cos) = (ELECTRON_REST_KEV, 1.0 - 2.0 * sin2_half_theta);
        let tau = 1.0 / (1.0 + 2.0 * energy_kev / m * sin2_half_theta);
        let momentum = |e: f64| {
            let q = (energy_kev * energy_kev + e * e - 2.0 * energy_kev * e * cos).sqrt();
            (energy_kev * e * 2.0 * sin2_half_theta / m - (energy_kev - e)) / q
        };
        let q_c = (1.0 + tau * tau - 2.0 * tau * cos).sqrt();
        let a = q_c + tau * (tau - cos) / q_c;
        let (mut weights, mut sum) = (0.0, 0.0);
        for shell in shells.iter().filter(|shell| shell.binding_kev < energy_kev) {
            let highest = momentum(energy_kev - shell.binding_kev);
            let reach = 3.5 / shell.profile_at_zero / ATOMIC_MOMENTA_PER_MC;
            let (low, high) = ((-reach).max(-0.999), reach.min(highest));
            for i in 0..steps {
                if high <= low {
                    break;
                }
                let edges = [f64::from(i), f64::from(i + 1)]
                    .map(|i| low + (high - low) * i / f64::from(steps));
                let p = 0.5 * (edges[0] + edges[1]);
                let share = shell.electrons_below(edges[1] * ATOMIC_MOMENTA_PER_MC)
                    - shell.electrons_below(edges[0] * ATOMIC_MOMENTA_PER_MC);
                let weight = shell.electrons * share * (1.0 + a * p.clamp(-0.2, 0.2));
                let (mut below, mut above) = (0.0, energy_kev);
                for _ in 0..32 {
                    let middle = 0.5 * (below + above);
                    if momentum(middle) < p {
                        below = middle;
                    } else {
                        above = middle;
                    }
                }
                weights += weight;
                sum += weight * below / (energy_kev * tau);
            }
        }
        if weights > 0.0 { sum / weights } else { 1.0 }
    }

    /// The same moments by quadrature over the differential cross-sections.
    fn expected(material: &Material, model: ComptonModel, energy_kev: f64) -> [f64; 5] {
        let steps = match model {
            ComptonModel::IncoherentFunction => 4000,
            ComptonModel::ImpulseApproximation => 150,
        };
        let shells = material.shells();
        let (mut rayleigh, mut compton) = ([0.0; 3], [0.0; 4]);
        for i in 0..4000 {
            // Steps in sin(θ/2), in which the forward peak is wide; dcos = −4 s ds.
            let s = (f64::from(i) + 0.5) / 4000.0;
            let cos = 1.0 - 2.0 * s * s;
            let q = s * energy_kev / HC_KEV_ANGSTROM;
            let thomson = s * (1.0 + cos * cos) * material.form_factor_squared_per_gram(q);
            for (sum, value) in rayleigh.iter_mut().zip([1.0, cos, cos * cos]) {
                *sum += thomson * value;
            }
        }
        for i in 0..steps {
            let s = (f64::from(i) + 0.5) / f64::from(steps);
            let cos = 1.0 - 2.0 * s * s;
            let free = s * differential(energy_kev, cos);
            let ratio = 1.0 / (1.0 + energy_kev / ELECTRON_REST_KEV * (1.0 - cos));
            let (electrons, shift) = match model {
                ComptonModel::IncoherentFunction => {
                    let q = s * energy_kev / HC_KEV_ANGSTROM;
                    (material.incoherent_per_gram(q), 1.0)
                }
                ComptonModel::ImpulseApproximation => (
                    electrons_freed(&shells, energy_kev, s * s),
                    mean_shift(&shells, energy_kev, s * s, 24),
                ),
            };
            for (sum, value) in
                compton
                    .iter_mut()
                    .zip([1.0, cos, cos * cos, energy_kev * ratio * shift])
            {
                *sum += free * electrons * value;
            }
        }
        [
            rayleigh[1] / rayleigh[0],
            rayleigh[2] / rayleigh[0],
            compton[1] / compton[0],
            compton[2] / compton[0],
            compton[3] / compton[0],
        ]
    }

    /// 120 comparisons at 4.5 standard errors: 8e-4 per seed. A shift of 1e-3 of the values would be 0.5 to 3 of them.
    #[test]
    fn scattering_has_the_moments_of_its_cross_section() {
        for name in ["water", "bone_cortical", "titanium", "lead"] {
            let material = Material::named(name).unwrap();
            for (energy_kev, model) in [5.0, 40.0, 150.0].into_iter().flat_map(|energy_kev| {
                [
                    (energy_kev, ComptonModel::ImpulseApproximation),
                    (energy_kev, ComptonModel::IncoherentFunction),
                ]
            }) {
                let z: Vec<f64> = moments(&material, model, energy_kev)
                    .iter()
                    .zip(expected(&material, model, energy_kev))
                    .map(|(moment, expected)| moment.z(expected))
                    .collect();
                assert!(
                    z.iter().all(|z| z.abs() < 4.5),
                    "{name} at {energy_kev} keV, {model:?}: {z:.1?} standard errors"
                );
            }
        }
    }

    /// The energy at a given angle, even where hardly any electron can be freed. 18 comparisons at 4.5 standard errors: 1e-4 per
    /// seed.
    #[test]
    fn energies_at_an_angle_have_the_mean_of_the_profiles() {
        for name in ["water", "bone_cortical", "lead"] {
            let material = Material::named(name).unwrap();
            let tables = MaterialTables::new(&material, ComptonModel::default());
            for (energy_kev, sin2_half_theta) in [10.0, 60.0].into_iter().flat_map(|energy_kev| {
                [2e-4, 0.02, 0.5].map(|sin2_half_theta| (energy_kev, sin2_half_theta))
            }) {
                let mut shift = Moment::default();
                let resting =
                    energy_kev / (1.0 + 2.0 * energy_kev / ELECTRON_REST_KEV * sin2_half_theta);
                for index in 0..SAMPLES {
                    let mut random = Philox::new(3, 0, index);
                    let cos = 1.0 - 2.0 * sin2_half_theta;
                    let sampled = tables.compton_energy_at(energy_kev, cos, || random.unit());
                    shift.add(sampled / resting);
                }
                let z = shift.z(mean_shift(
                    &material.shells(),
                    energy_kev,
                    sin2_half_theta,
                    1000,
                ));
                assert!(
                    z.abs() < 4.5,
                    "{name}, {energy_kev} keV, {sin2_half_theta}: {z:.1}"
                );
            }
        }
    }

    /// Our integrals agree with the reference to 1e-3 (of 1 or of the value), and the samplers follow them.
    #[test]
    #[ignore = "needs ../shared/reference/xray"]
    fn scatter_moments_agree_with_xraylib() {
        let shared = std::env::var_os("PPA_SHARED").map_or_else(
            || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared")),
            PathBuf::from,
        );
        let model = ComptonModel::IncoherentFunction;
        let text =
            fs::read_to_string(shared.join("reference/xray/scatter_moments_xraylib.csv")).unwrap();
        for line in text.lines().skip(1) {
            let columns: Vec<&str> = line.split(',').collect();
            let numbers: Vec<f64> = columns[1..]
                .iter()
                .map(|column| column.parse().unwrap())
                .collect();
            let material = Material::named(columns[0].trim_end_matches("_icrp")).unwrap();
            let integrals = expected(&material, model, numbers[0]);
            let sampled = moments(&material, model, numbers[0]);
            println!("{line}\n  {integrals:.5?}");
            for ((moment, integral), reference) in sampled.iter().zip(integrals).zip(&numbers[1..])
            {
                assert!(
                    (integral - reference).abs() < 1e-3 * reference.abs().max(1.0),
                    "{line}: {integral}"
                );
                assert!(
                    moment.z(integral).abs() < 4.5,
                    "{line}: {:.1} standard errors",
                    moment.z(integral)
                );
            }
        }
    }
}
