//! Probability density of scattering into a given direction, for next-event estimation.

use std::f64::consts::PI;

use crate::{
    matter::compton::ComptonModel, matter::cross_sections::HC_KEV_ANGSTROM,
    matter::energy_range::MAX_ENERGY_KEV, matter::form_factors::FormFactors,
    matter::impulse_approximation::electrons_freed, matter::klein_nishina::differential,
    matter::material::Material, matter::thomson::ThomsonIntegral, octaves::Octaves,
};

/// Lowest energy of the tables in keV, just below that of the transport; its values are used below it.
const LOWEST_KEV: f64 = 4.0;
/// Bins per octave of energy of the normalising integrals, as a power of two.
const ENERGY_BITS: u32 = 6;
/// Bins per octave of energy of the contributing electrons, which depend little on it, as a power of two.
const ROW_BITS: u32 = 2;
/// Bins per octave of q² and smallest q² in 1/Å², for F² and for the contributing electrons.
const FORM_FACTOR: (u32, f64) = (5, 1e-5);
const ELECTRONS: (u32, f64) = (3, 1e-4);
/// Intervals of the normalising integrals over sin(θ/2).
const INTERVALS: usize = 256;

/// Densities of Rayleigh and Compton scattering of one material over the sphere of directions, from 4 to 150 keV.
///
/// They are the distributions sampled by [`crate::MaterialTables`]; each integrates to 1.
#[derive(Clone, Debug)]
pub struct ScatterDensities {
    energies: Octaves,
    form_factor: Curve,
    rayleigh_integral: Vec<f32>,
    rows: Octaves,
    /// Contributing electrons by q², for each energy of `rows`; a single curve if they do not depend on the energy.
    electrons: Vec<Curve>,
    compton_integral: Vec<f32>,
}

impl ScatterDensities {
    /// Prepares the densities of a material.
    #[must_use]
    pub fn new(material: &Material, model: ComptonModel) -> Self {
        let form_factor = Curve::new(FORM_FACTOR, |q| material.form_factor_squared_per_gram(q));
        let rows = Octaves::covering(LOWEST_KEV, MAX_ENERGY_KEV, ROW_BITS);
        let electrons = match model {
            ComptonModel::IncoherentFunction => {
                vec![Curve::new(ELECTRONS, |q| material.incoherent_per_gram(q))]
            }
            ComptonModel::ImpulseApproximation => {
                let shells = material.shells();
                let at = |energy: f64| {
                    let per_q = HC_KEV_ANGSTROM / energy;
                    Curve::new(ELECTRONS, |q| {
                        electrons_freed(&shells, energy, (q * per_q).powi(2))
                    })
                };
                rows.nodes().map(at).collect()
            }
        };
        let mut densities = Self {
            energies: Octaves::covering(LOWEST_KEV, MAX_ENERGY_KEV, ENERGY_BITS),
            form_factor,
            rayleigh_integral: Vec::new(),
            rows,
            electrons,
            compton_integral: Vec::new(),
        };
        let integrals = |relative: &dyn Fn(f64, f64) -> f64| -> Vec<f32> {
            let nodes = densities.energies.nodes();
            nodes
                .map(|energy| {
                    over_the_sphere(|sin2_half_theta| relative(energy, sin2_half_theta)) as f32
                })
                .collect()
        };
        let rayleigh_integral = match material.form_factors() {
            FormFactors::IndependentAtoms => {
                integrals(&|energy, sin2_half_theta| densities.rayleigh(energy, sin2_half_theta))
            }
            // Peaks in q are narrower than the steps of Simpson's rule at high energies.
            FormFactors::Molecular => {
                let integral = densities.form_factor.thomson_integral();
                let nodes = densities.energies.nodes();
                nodes
                    .map(|energy| integral.over_the_sphere(q_squared(energy, 1.0)) as f32)
                    .collect()
            }
        };
        let compton_integral =
            integrals(&|energy, sin2_half_theta| densities.compton(energy, sin2_half_theta));
        densities.rayleigh_integral = rayleigh_integral;
        densities.compton_integral = compton_integral;
        densities
    }

    /// Density of Rayleigh scattering by θ, per steradian.
    #[inline]
    #[must_use]
    pub fn rayleigh_density(&self, energy_kev: f64, cos_theta: f64) -> f64 {
        self.rayleigh(energy_kev, 0.5 * (1.0 - cos_theta))
            / self.integral(&self.rayleigh_integral, energy_kev)
    }

    /// Density of Compton scattering by θ, for any energy of the scattered photon, per steradian.
    #[inline]
    #[must_use]
    pub fn compton_density(&self, energy_kev: f64, cos_theta: f64) -> f64 {
        self.compton(energy_kev, 0.5 * (1.0 - cos_theta))
            / self.integral(&self.compton_integral, energy_kev)
    }

    #[inline]
    fn integral(&self, integrals: &[f32], energy_kev: f64) -> f64 {
        let (bin, fraction) = self.energies.locate(energy_kev);
        let [low, high] = [bin, bin + 1].map(|i| f64::from(integrals[i]));
        low + fraction * (high - low)
    }

    /// F² (1 + cos²θ) at sin²(θ/2) = `sin2_half_theta`.
    #[inline]
    fn rayleigh(&self, energy_kev: f64, sin2_half_theta: f64) -> f64 {
        let cos = 1.0 - 2.0 * sin2_half_theta;
        self.form_factor.at(q_squared(energy_kev, sin2_half_theta)) * (1.0 + cos * cos)
    }

    /// Klein–Nishina times the contributing electrons.
    #[inline]
    fn compton(&self, energy_kev: f64, sin2_half_theta: f64) -> f64 {
        let x = q_squared(energy_kev, sin2_half_theta);
        let electrons = if let [only] = self.electrons.as_slice() {
            only.at(x)
        } else {
            let (row, fraction) = self.rows.locate(energy_kev);
            let [low, high] = [row, row + 1].map(|row| self.electrons[row].at(x));
            low + fraction * (high - low)
        };
        differential(energy_kev, 1.0 - 2.0 * sin2_half_theta) * electrons
    }
}

#[inline]
fn q_squared(energy_kev: f64, sin2_half_theta: f64) -> f64 {
    sin2_half_theta * (energy_kev * (1.0 / HC_KEV_ANGSTROM)).powi(2)
}

/// Integral over all directions by Simpson's rule in s = sin(θ/2), in which forward peaks are wide; dΩ = 8π s ds.
fn over_the_sphere(relative: impl Fn(f64) -> f64) -> f64 {
    let simpson = |i: usize| match i {
        0 | INTERVALS => 1.0,
        _ => 2.0 + 2.0 * (i % 2) as f64,
    };
    let sum: f64 = (0..=INTERVALS)
        .map(|i| {
            let s = i as f64 / INTERVALS as f64;
            simpson(i) * s * relative(s * s)
        })
        .sum();
    sum / (3.0 * INTERVALS as f64) * 8.0 * PI
}

/// A function of q over x = q², linear between the nodes and down to its value at q = 0.
#[derive(Clone, Debug)]
struct Curve {
    grid: Octaves,
    at_zero: f32,
    values: Vec<f32>,
}

impl Curve {
    fn new((bits, smallest): (u32, f64), of_q: impl Fn(f64) -> f64) -> Self {
        let grid = Octaves::covering(smallest, (MAX_ENERGY_KEV / HC_KEV_ANGSTROM).powi(2), bits);
        Self {
            grid,
            at_zero: of_q(0.0) as f32,
            values: grid.nodes().map(|x| of_q(x.sqrt()) as f32).collect(),
        }
    }

    fn thomson_integral(&self) -> ThomsonIntegral {
        let values = std::iter::once(self.at_zero).chain(self.values.iter().copied());
        ThomsonIntegral::new(
            std::iter::once(0.0).chain(self.grid.nodes()).collect(),
            values.map(f64::from).collect(),
        )
    }

    #[inline]
    fn at(&self, x: f64) -> f64 {
        let first = self.grid.first();
        let (low, high, fraction) = if x < first {
            (self.at_zero, self.values[0], x / first)
        } else {
            let (bin, fraction) = self.grid.locate(x);
            (self.values[bin], self.values[bin + 1], fraction)
        };
        f64::from(low) + fraction * f64::from(high - low)
    }
}

#[cfg(test)]
mod tests {
    use ppa_core::random::Philox;

    use super::*;
    use crate::matter::sampler::MaterialTables;

    const MODELS: [ComptonModel; 2] = [
        ComptonModel::ImpulseApproximation,
        ComptonModel::IncoherentFunction,
    ];

    /// Integral of a density over a shell of directions between two values of sin(θ/2).
    fn probability(density: impl Fn(f64) -> f64, low: f64, high: f64) -> f64 {
        let steps = 16;
        (0..steps)
            .map(|i| {
                let s = low + (high - low) * (f64::from(i) + 0.5) / f64::from(steps);
                8.0 * PI * s * density(1.0 - 2.0 * s * s) * (high - low) / f64::from(steps)
            })
            .sum()
    }

    #[test]
    fn densities_integrate_to_one() {
        for (name, model) in ["water", "bone_cortical", "csi", "lead"]
            .into_iter()
            .flat_map(|name| MODELS.map(|model| (name, model)))
        {
            let densities = ScatterDensities::new(&Material::named(name).unwrap(), model);
            for energy_kev in [5.0, 7.3, 20.0, 34.5, 61.0, 119.0, 150.0] {
                let whole = |density: &dyn Fn(f64) -> f64| -> f64 {
                    (0..200)
                        .map(|i| {
                            let low = f64::from(i) / 200.0;
                            probability(density, low, low + 0.005)
                        })
                        .sum()
                };
                let rayleigh = whole(&|cos| densities.rayleigh_density(energy_kev, cos));
                let compton = whole(&|cos| densities.compton_density(energy_kev, cos));
                for (kind, whole) in [("Rayleigh", rayleigh), ("Compton", compton)] {
                    assert!(
                        (whole - 1.0).abs() < 1e-3,
                        "{kind}, {name}, {energy_kev} keV, {model:?}: {whole}"
                    );
                }
            }
        }
    }

    /// χ² of 40 bins of sin(θ/2) against 100 000 samples. Above 39 + 6 √78 = 92 by chance: 4e-6 each, 2e-4 for the
    /// 39 comparisons.
    #[test]
    fn samples_follow_the_densities() {
        const BINS: usize = 40;
        const SAMPLES: u64 = 100_000;
        let atoms =
            ["water", "bone_cortical", "lead"].map(|name| (name, FormFactors::IndependentAtoms));
        let molecules =
            ["water", "adipose", "soft_tissue", "pmma"].map(|name| (name, FormFactors::Molecular));
        for ((name, form_factors), energy_kev) in atoms
            .into_iter()
            .chain(molecules)
            .flat_map(|material| [7.0, 30.0, 90.0].map(|energy_kev| (material, energy_kev)))
        {
            let material = Material::named(name)
                .unwrap()
                .with_form_factors(form_factors);
            for (model, with_rayleigh) in MODELS.into_iter().zip([true, false]) {
                let tables = MaterialTables::new(&material, model);
                let densities = ScatterDensities::new(&material, model);
                let mut counts = [[0_u32; BINS]; 2];
                for index in 0..SAMPLES {
                    let mut random = Philox::new(17, 0, index);
                    let bin = |sin2_half_theta: f64| {
                        ((sin2_half_theta.sqrt() * BINS as f64) as usize).min(BINS - 1)
                    };
                    let rayleigh = tables.rayleigh_sin2_half_theta(energy_kev, || random.unit());
                    counts[0][bin(rayleigh)] += 1;
                    let compton = tables.compton_scattering(energy_kev, || random.unit());
                    counts[1][bin(compton.sin2_half_theta)] += 1;
                }
                for (kind, counts) in counts.iter().enumerate() {
                    let compton = form_factors == FormFactors::IndependentAtoms;
                    if kind == 0 && !with_rayleigh || kind == 1 && !compton {
                        continue; // the model does not change it
                    }
                    let density = |cos: f64| match kind {
                        0 => densities.rayleigh_density(energy_kev, cos),
                        _ => densities.compton_density(energy_kev, cos),
                    };
                    let mut chi_squared = 0.0;
                    for (bin, &count) in counts.iter().enumerate() {
                        let [low, high] = [bin, bin + 1].map(|b| b as f64 / BINS as f64);
                        let expected = SAMPLES as f64 * probability(density, low, high);
                        if expected < 5.0 {
                            // Too few for the normal approximation: allow a few counts more.
                            assert!(f64::from(count) < expected + 6.0 * expected.sqrt() + 6.0);
                        } else {
                            chi_squared += (f64::from(count) - expected).powi(2) / expected;
                        }
                    }
                    assert!(
                        chi_squared < 92.0,
                        "{name}, {form_factors:?}, {energy_kev} keV, {model:?}, kind {kind}: χ² {chi_squared:.0}"
                    );
                }
            }
        }
    }
}
