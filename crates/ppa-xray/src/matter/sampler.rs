//! One material prepared for transport: cross sections without logarithms, and the scattering samplers.

use crate::{
    matter::compton::Compton,
    matter::cross_sections::{CrossSections, HC_KEV_ANGSTROM, MAX_ENERGY_KEV, MIN_ENERGY_KEV},
    matter::material::Material,
    matter::rayleigh::Rayleigh,
    octaves::Octaves,
    philox::Philox,
};

/// Bins per octave of energy, as a power of two: straight lines in E are then within 1e-4 of E⁻³ laws.
const ENERGY_BITS: u32 = 8;
/// Largest relative departure from a straight line in a bin; beyond it the material itself is asked.
const STRAIGHT: f64 = 5e-4;
/// Bins per octave of q², as a power of two.
const Q_SQUARED_BITS: u32 = 5;
/// Smallest q² node in 1/Å²: below it F² and S are linear in q².
const MIN_Q_SQUARED: f64 = 1e-5;

/// Cross sections and samplers of one material for photons of 1 to 150 keV.
#[derive(Clone, Debug)]
pub struct MaterialTables {
    material: Material,
    grid: Octaves,
    bins: Vec<Bin>,
    rayleigh: Rayleigh,
    compton: Compton,
}

/// Cross sections at the lower end of an energy bin and their change across it, cm²/g.
#[derive(Clone, Copy, Debug)]
struct Bin {
    photoelectric: [f32; 2],
    rayleigh: [f32; 2],
    compton: [f32; 2],
}

impl Bin {
    /// Marks a bin in which the photoelectric part is no straight line, because of an edge or the fine structure
    /// below one: there the material itself is asked.
    const CUT: f32 = f32::NAN;

    fn new(low: CrossSections, high: CrossSections) -> Self {
        let line = |low: f64, high: f64| [low as f32, (high - low) as f32];
        Self {
            photoelectric: line(low.photoelectric, high.photoelectric),
            rayleigh: line(low.rayleigh, high.rayleigh),
            compton: line(low.compton, high.compton),
        }
    }

    #[inline]
    fn at(&self, fraction: f64) -> CrossSections {
        let line = |[low, change]: [f32; 2]| f64::from(low) + f64::from(change) * fraction;
        CrossSections {
            photoelectric: line(self.photoelectric),
            rayleigh: line(self.rayleigh),
            compton: line(self.compton),
        }
    }
}

impl MaterialTables {
    /// Prepares a material.
    #[must_use]
    pub fn new(material: &Material) -> Self {
        let grid = Octaves::covering(MIN_ENERGY_KEV, MAX_ENERGY_KEV, ENERGY_BITS);
        let mut low = material.cross_sections_unchecked(grid.first());
        let mut bins: Vec<Bin> = (0..grid.bins())
            .map(|index| {
                let high = material.cross_sections_unchecked(grid.node(index + 1));
                let mut bin = Bin::new(low, high);
                let width = grid.node(index + 1) - grid.node(index);
                let bent = [0.25, 0.5, 0.75].into_iter().any(|fraction| {
                    let direct =
                        material.cross_sections_unchecked(grid.node(index) + fraction * width);
                    (bin.at(fraction).photoelectric / direct.photoelectric - 1.0).abs() > STRAIGHT
                });
                if bent {
                    bin.photoelectric = [Bin::CUT; 2];
                }
                low = high;
                bin
            })
            .collect();
        for edge in material.edges_kev() {
            bins[grid.locate(edge).0].photoelectric = [Bin::CUT; 2];
        }
        let q_squared = Octaves::covering(
            MIN_Q_SQUARED,
            (MAX_ENERGY_KEV / HC_KEV_ANGSTROM).powi(2),
            Q_SQUARED_BITS,
        );
        Self {
            grid,
            bins,
            rayleigh: Rayleigh::new(material, q_squared),
            compton: Compton::new(material, q_squared),
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
        let (index, fraction) = self.grid.locate(energy_kev);
        let bin = &self.bins[index];
        if bin.photoelectric[0].is_nan() {
            return self.asked(energy_kev);
        }
        bin.at(fraction)
    }

    #[cold]
    fn asked(&self, energy_kev: f64) -> CrossSections {
        self.material
            .cross_sections_unchecked(energy_kev.clamp(MIN_ENERGY_KEV, MAX_ENERGY_KEV))
    }

    /// Cosine of a Rayleigh scattering angle.
    #[inline]
    pub(crate) fn sample_rayleigh(&self, energy_kev: f64, random: &mut Philox) -> f64 {
        self.rayleigh.sample(energy_kev, random)
    }

    /// Cosine of a Compton scattering angle and the energy of the scattered photon in keV.
    #[inline]
    pub(crate) fn sample_compton(&self, energy_kev: f64, random: &mut Philox) -> (f64, f64) {
        self.compton.sample(energy_kev, random)
    }
}

#[cfg(test)]
mod tests {
    use std::{fs, path::PathBuf};

    use super::*;
    use crate::matter::cross_sections::ELECTRON_REST_KEV;

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

        /// Distance of the mean from `expected` in its standard errors.
        fn z(&self, expected: f64) -> f64 {
            let n = SAMPLES as f64;
            let mean = self.sum / n;
            (mean - expected) / ((self.squares / n - mean * mean) / n).sqrt()
        }
    }

    /// ⟨cos⟩, ⟨cos²⟩ of Rayleigh and ⟨cos⟩, ⟨cos²⟩, ⟨E′⟩ of Compton scattering by sampling.
    fn moments(material: &Material, energy_kev: f64) -> [Moment; 5] {
        let tables = MaterialTables::new(material);
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

    /// The same moments by the midpoint rule over the differential cross-sections.
    fn expected(material: &Material, energy_kev: f64) -> [f64; 5] {
        const STEPS: usize = 40_000;
        let alpha = energy_kev / ELECTRON_REST_KEV;
        let (mut rayleigh, mut compton) = ([0.0; 3], [0.0; 4]);
        for i in 0..STEPS {
            // Steps in sin(θ/2), in which the forward peak is wide; dcos = −4 s ds.
            let s = (i as f64 + 0.5) / STEPS as f64;
            let cos = 1.0 - 2.0 * s * s;
            let q = s * energy_kev / HC_KEV_ANGSTROM;
            let thomson = s * (1.0 + cos * cos) * material.form_factor_squared_per_gram(q);
            let ratio = 1.0 / (1.0 + alpha * (1.0 - cos));
            let klein_nishina = s
                * ratio
                * ratio
                * (ratio + 1.0 / ratio - 1.0 + cos * cos)
                * material.incoherent_per_gram(q);
            for (sum, value) in rayleigh.iter_mut().zip([1.0, cos, cos * cos]) {
                *sum += thomson * value;
            }
            for (sum, value) in compton
                .iter_mut()
                .zip([1.0, cos, cos * cos, energy_kev * ratio])
            {
                *sum += klein_nishina * value;
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

    /// 60 comparisons at 4.5 standard errors: 4e-4 per seed. A shift of 1e-3 of the values would be 0.5 to 3 of them.
    #[test]
    fn scattering_has_the_moments_of_its_cross_section() {
        for name in ["water", "bone_cortical", "titanium", "lead"] {
            let material = Material::named(name).unwrap();
            for energy_kev in [5.0, 40.0, 150.0] {
                let z: Vec<f64> = moments(&material, energy_kev)
                    .iter()
                    .zip(expected(&material, energy_kev))
                    .map(|(moment, expected)| moment.z(expected))
                    .collect();
                assert!(
                    z.iter().all(|z| z.abs() < 4.5),
                    "{name} at {energy_kev} keV: {z:.1?} standard errors"
                );
            }
        }
    }

    /// Our integrals are those of the reference to 1e-3 (of 1 or of the value), and the samplers follow them.
    #[test]
    #[ignore = "needs ../shared/reference/xray"]
    fn scatter_moments_agree_with_xraylib() {
        let shared = std::env::var_os("PPA_SHARED").map_or_else(
            || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared")),
            PathBuf::from,
        );
        let text =
            fs::read_to_string(shared.join("reference/xray/scatter_moments_xraylib.csv")).unwrap();
        for line in text.lines().skip(1) {
            let columns: Vec<&str> = line.split(',').collect();
            let numbers: Vec<f64> = columns[1..]
                .iter()
                .map(|column| column.parse().unwrap())
                .collect();
            let material = Material::named(columns[0].trim_end_matches("_icrp")).unwrap();
            let integrals = expected(&material, numbers[0]);
            let sampled = moments(&material, numbers[0]);
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
