//! Energy that photons of one energy deposit in a layer.

use crate::detector::escape::{KRay, Loss, Scattered};
use crate::detector::layer::Layer;
use crate::detector::quadrature::gauss_legendre;
use crate::matter::cross_sections::ELECTRON_REST_KEV;
use crate::matter::klein_nishina::{differential, energy_ratio};

/// Points of the integral over the polar angle of Compton scattering.
const POLAR: usize = 10;

/// Energy losses from the layer for photons of one energy.
pub(crate) struct LayerResponse {
    energy_kev: f64,
    thickness: f64,
    k_rays: Vec<KRay>,
    scattered: Vec<Scattered>,
    /// K x-rays emitted where scattered photons, of their mean energy, interact again.
    k_rays_of_scattered: Vec<KRay>,
}

impl LayerResponse {
    pub fn new(layer: &Layer, energy_kev: f64) -> Self {
        let at = layer.thickness(energy_kev);
        let alpha = energy_kev / ELECTRON_REST_KEV;
        // Klein–Nishina per solid angle.
        let angles = gauss_legendre::<POLAR>().map(|(x, weight)| {
            let cos = 2.0 * x - 1.0;
            let scattered_kev = energy_ratio(alpha, cos) * energy_kev;
            (weight * differential(energy_kev, cos), cos, scattered_kev)
        });
        let sum: f64 = angles.iter().map(|(weight, ..)| weight).sum();
        let scattered = angles.map(|(weight, cos, energy_kev)| Scattered {
            probability: at.compton / at.total() * weight / sum,
            cos,
            energy_kev,
            thickness: layer.thickness(energy_kev).total(),
        });
        let mean_kev: f64 = angles
            .iter()
            .map(|(weight, _, kev)| weight * kev)
            .sum::<f64>()
            / sum;
        Self {
            energy_kev,
            thickness: at.total(),
            k_rays: KRay::of_photons(layer, energy_kev),
            scattered: scattered.into(),
            k_rays_of_scattered: KRay::of_photons(layer, mean_kev),
        }
    }

    /// ⟨ε⟩/E and ⟨ε²⟩/E² at incidence `cos`; `depths` integrates over [0, 1].
    pub fn at(&self, cos: f64, depths: &[(f64, f64)]) -> [f64; 2] {
        let slant = self.thickness / cos;
        let interacts = -(-slant).exp_m1();
        let mut loss = Loss::default();
        for &(x, weight) in depths {
            // Share of the layer above the interaction.
            let depth = (-(-x * interacts).ln_1p() / slant).clamp(0.0, 1.0);
            loss.add_k_rays(weight, &self.k_rays, depth, self.energy_kev);
            let mut stays = 0.0;
            for scattered in &self.scattered {
                let out = scattered.escape(depth, cos);
                stays += weight * scattered.probability * (1.0 - out);
                let share = scattered.energy_kev / self.energy_kev;
                loss.add(weight * scattered.probability * out, share);
            }
            loss.add_k_rays(stays, &self.k_rays_of_scattered, depth, self.energy_kev);
        }
        [
            interacts * (1.0 - loss.energy),
            interacts * (1.0 - loss.square),
        ]
    }
}
