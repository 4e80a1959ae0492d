//! Compton scattering off free electrons at rest, weighted with the incoherent scattering function S(q).

use crate::matter::cross_sections::ELECTRON_REST_KEV;
use crate::{
    matter::cross_sections::HC_KEV_ANGSTROM,
    matter::klein_nishina::{KleinNishina, energy_ratio},
    matter::material::Material,
    octaves::Octaves,
};

/// Sampler of Klein–Nishina × S(q) in one material.
#[derive(Clone, Debug)]
pub(crate) struct IncoherentFunction {
    angles: &'static KleinNishina,
    /// S of the material over x = q², relative, non-decreasing.
    incoherent: Vec<f32>,
    grid: Octaves,
}

impl IncoherentFunction {
    pub(crate) fn new(material: &Material, grid: Octaves) -> Self {
        let mut largest = 0.0_f64;
        let incoherent = grid
            .nodes()
            .map(|x| {
                largest = largest.max(material.incoherent_per_gram(x.sqrt()));
                largest as f32
            })
            .collect();
        Self {
            angles: KleinNishina::table(),
            incoherent,
            grid,
        }
    }

    /// S at x = q², up to a constant.
    #[inline]
    pub(crate) fn at(&self, x: f64) -> f64 {
        let (bin, fraction) = self.grid.locate(x);
        let (low, high) = (
            f64::from(self.incoherent[bin]),
            f64::from(self.incoherent[bin + 1]),
        );
        if x < self.grid.first() {
            low * x / self.grid.first() // S ∝ q² near the origin
        } else {
            low + (high - low) * fraction
        }
    }

    /// Samples sin²(θ/2) and the energy of the scattered photon in keV: a Klein–Nishina angle is accepted with S/S(backwards).
    #[inline]
    pub(crate) fn sample(&self, energy_kev: f32, mut uniform: impl FnMut() -> f32) -> (f32, f32) {
        let energy = f64::from(energy_kev);
        let x_backwards = (energy * (1.0 / HC_KEV_ANGSTROM)).powi(2);
        let bound = self.at(x_backwards);
        loop {
            let sin2_half_theta = self.angles.half_angle_squared(energy_kev, uniform());
            let threshold = f64::from(uniform()) * bound;
            if threshold <= self.at(x_backwards * f64::from(sin2_half_theta)) {
                let cos = 1.0 - 2.0 * f64::from(sin2_half_theta);
                let ratio = energy_ratio(energy * (1.0 / ELECTRON_REST_KEV), cos);
                return (sin2_half_theta, (energy * ratio) as f32);
            }
        }
    }
}
