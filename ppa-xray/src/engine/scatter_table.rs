//! Differential scattering of one material at one energy, tabulated by angle.
//!
//! docs/physics.md, "Photon data and scattering".

use ppa_core::random::Philox;

use crate::matter::sampler::MaterialTables;
use crate::matter::scatter_density::ScatterDensities;
use crate::transport::attenuation::Coefficients;

/// Steps of sin(θ/2), in which forward peaks are wide: at 150 keV the Rayleigh peak of heavy elements covers 10 of them.
pub(super) const STEPS: usize = 512;

/// Interval, in steps, at which the mean energy after Compton scattering is computed, and the number of samples for it.
const ENERGY_STEPS: usize = 8;
const DRAWS: u32 = 32;

/// Scattering of a gram, mm⁻¹ per g/cm³ and sr, and the mean energy after Compton scattering.
#[derive(Debug)]
pub(crate) struct ScatterTable {
    rows: Vec<[f32; 3]>,
}

impl ScatterTable {
    pub fn new(
        densities: &ScatterDensities,
        tables: &MaterialTables,
        energy_kev: f64,
        c: &Coefficients,
    ) -> Self {
        let cos = |step: usize| 1.0 - 2.0 * (step as f64 / STEPS as f64).powi(2);
        let compton = f64::from(c.with_compton - c.photoelectric);
        let rayleigh = f64::from(c.total - c.with_compton);
        let mean_kev: Vec<f64> = (0..=STEPS / ENERGY_STEPS)
            .map(|node| {
                // The random samples are part of the table: the same for every image.
                let mut rng = Philox::new(0, 0, node as u64);
                let draw = |_| {
                    tables.compton_energy_at(energy_kev, cos(node * ENERGY_STEPS), || rng.unit())
                };
                (0..DRAWS).map(draw).sum::<f64>() / f64::from(DRAWS)
            })
            .collect();
        Self {
            rows: (0..=STEPS)
                .map(|step| {
                    let node = (step / ENERGY_STEPS).min(mean_kev.len() - 2);
                    let fraction = (step - node * ENERGY_STEPS) as f64 / ENERGY_STEPS as f64;
                    let scattered_kev =
                        mean_kev[node] + fraction * (mean_kev[node + 1] - mean_kev[node]);
                    [
                        compton * densities.compton_density(energy_kev, cos(step)),
                        rayleigh * densities.rayleigh_density(energy_kev, cos(step)),
                        scattered_kev,
                    ]
                    .map(|value| value as f32)
                })
                .collect(),
        }
    }

    /// Position of an angle between two steps.
    #[inline]
    pub fn locate(cos_theta: f64) -> (usize, f32) {
        let at = (0.5 * (1.0 - cos_theta)).max(0.0).sqrt() * STEPS as f64;
        let step = (at as usize).min(STEPS - 1);
        (step, (at - step as f64) as f32)
    }

    /// Compton and Rayleigh scattering and the mean energy after Compton scattering, step by step.
    pub fn rows(&self) -> &[[f32; 3]] {
        &self.rows
    }

    /// Compton and Rayleigh scattering together, step by step.
    pub fn in_all(&self) -> Vec<f32> {
        self.rows
            .iter()
            .map(|[compton, rayleigh, _]| compton + rayleigh)
            .collect()
    }
}
