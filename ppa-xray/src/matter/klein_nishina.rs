//! Scattering angle of a photon off a free electron at rest.

use std::sync::OnceLock;

use crate::matter::cross_sections::ELECTRON_REST_KEV;
use crate::matter::energy_range::MAX_ENERGY_KEV;

/// E′/E = 1 / (1 + α (1 − cos θ)), α = E / mₑc² (Compton 1923, doi:10.1103/PhysRev.21.483).
#[inline]
pub(crate) fn energy_ratio(alpha: f64, cos_theta: f64) -> f64 {
    1.0 / (1.0 + alpha * (1.0 - cos_theta))
}

/// dσ/dΩ in units of ½ rₑ²: τ² (τ + 1/τ − sin²θ), τ = E′/E (Klein and Nishina 1929, doi:10.1007/BF01366453).
#[inline]
pub(crate) fn differential(energy_kev: f64, cos_theta: f64) -> f64 {
    let ratio = energy_ratio(energy_kev * (1.0 / ELECTRON_REST_KEV), cos_theta);
    ratio * (1.0 + ratio * (ratio - 1.0 + cos_theta * cos_theta))
}

/// Energies of the table, from 0 in steps of [`STEP_KEV`].
const ROWS: usize = 31;
const STEP_KEV: f64 = MAX_ENERGY_KEV / (ROWS - 1) as f64;
/// Intervals of the cumulative probability.
const COLUMNS: usize = 64;

/// Quantiles of sin²(θ/2) by energy, linear between the nodes; moments are correct to 1e-4.
#[derive(Debug)]
pub(crate) struct KleinNishina {
    quantiles: [[f32; COLUMNS + 1]; ROWS],
}

impl KleinNishina {
    /// Returns the table, computed once.
    pub(crate) fn table() -> &'static Self {
        static TABLE: OnceLock<KleinNishina> = OnceLock::new();
        TABLE.get_or_init(|| Self {
            quantiles: std::array::from_fn(|row| quantiles(row as f64 * STEP_KEV)),
        })
    }

    /// sin²(θ/2) at cumulative probability `u`, for energies up to 150 keV.
    #[inline(always)]
    pub(crate) fn half_angle_squared(&self, energy_kev: f32, u: f32) -> f32 {
        let (row, column) = (
            energy_kev * (1.0 / STEP_KEV) as f32,
            u * const { COLUMNS as f32 },
        );
        let (i, j) = (
            (row as usize).min(ROWS - 2),
            (column as usize).min(COLUMNS - 1),
        );
        let (x, y) = (row - i as f32, column - j as f32);
        let line = |i: usize| {
            let at = &self.quantiles[i];
            at[j] + y * (at[j + 1] - at[j])
        };
        let (low, high) = (line(i), line(i + 1));
        low + x * (high - low)
    }
}

fn quantiles(energy_kev: f64) -> [f32; COLUMNS + 1] {
    const STEPS: usize = 8192;
    let density = |i: usize| differential(energy_kev, 1.0 - 2.0 * i as f64 / STEPS as f64);
    let mut cumulative = vec![0.0];
    for i in 0..STEPS {
        cumulative.push(cumulative[i] + density(i) + density(i + 1));
    }
    let mut at = 0;
    std::array::from_fn(|column| {
        let target = cumulative[STEPS] * column as f64 / COLUMNS as f64;
        while at + 1 < STEPS && cumulative[at + 1] < target {
            at += 1;
        }
        let into = (target - cumulative[at]) / (cumulative[at + 1] - cumulative[at]);
        ((at as f64 + into) / STEPS as f64) as f32
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moments of the table's quantiles against Simpson's rule over the formula.
    #[test]
    fn quantiles_have_the_moments_of_the_formula() {
        let table = KleinNishina::table();
        for energy_kev in [0.0, 5.0, 23.0, 45.0, 88.0, 120.0, 150.0] {
            let n = 2000;
            let mut exact = [0.0; 4];
            for i in 0..=n {
                let simpson = if i == 0 || i == n {
                    1.0
                } else {
                    2.0 + 2.0 * f64::from(i % 2)
                };
                let cos = 1.0 - 2.0 * f64::from(i) / f64::from(n);
                let weight = simpson * differential(energy_kev, cos);
                let ratio = energy_ratio(energy_kev / ELECTRON_REST_KEV, cos);
                for (sum, value) in exact.iter_mut().zip([1.0, cos, cos * cos, ratio]) {
                    *sum += weight * value;
                }
            }
            let mut sampled = [0.0; 4];
            let samples = 20_000;
            for i in 0..samples {
                let u = (f64::from(i) + 0.5) / f64::from(samples);
                let sin2_half_theta =
                    f64::from(table.half_angle_squared(energy_kev as f32, u as f32));
                assert!((0.0..=1.0).contains(&sin2_half_theta));
                let cos = 1.0 - 2.0 * sin2_half_theta;
                let ratio = energy_ratio(energy_kev / ELECTRON_REST_KEV, cos);
                for (sum, value) in sampled.iter_mut().zip([1.0, cos, cos * cos, ratio]) {
                    *sum += value;
                }
            }
            for moment in 1..4 {
                let error = sampled[moment] / sampled[0] - exact[moment] / exact[0];
                assert!(
                    error.abs() < 1e-4,
                    "moment {moment} at {energy_kev}: {error}"
                );
            }
        }
    }
}
