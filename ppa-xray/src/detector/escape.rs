//! Photons that escape from a layer: K x-rays and scattered photons.

use std::f64::consts::TAU;

use crate::detector::layer::Layer;
use crate::detector::quadrature::e2;

/// Points of the integral over the azimuth of Compton scattering.
const AZIMUTHS: usize = 6;

/// A K x-ray, emitted isotropically.
pub(crate) struct KRay {
    /// Probability per interaction of the photon that causes it.
    probability: f64,
    energy_kev: f64,
    /// Optical thickness of the layer for it.
    thickness: f64,
    /// K x-rays of lighter elements emitted where it interacts again.
    next: Vec<KRay>,
}

impl KRay {
    /// K x-rays per interaction of photons of one energy.
    pub fn of_photons(layer: &Layer, energy_kev: f64) -> Vec<Self> {
        let at = layer.thickness(energy_kev);
        let lines = layer.material.k_fluorescence(energy_kev).into_iter();
        lines
            .map(|line| Self {
                probability: at.photoelectric / at.total() * line.probability,
                energy_kev: line.energy_kev,
                thickness: layer.thickness(line.energy_kev).total(),
                next: Self::of_photons(layer, line.energy_kev),
            })
            .collect()
    }

    /// Probability of escape from a depth (share of the layer).
    fn escape(&self, depth: f64) -> f64 {
        0.5 * (e2(self.thickness * depth) + e2(self.thickness * (1.0 - depth)))
    }
}

/// Compton scattering by one angle.
pub(crate) struct Scattered {
    /// Probability per interaction.
    pub probability: f64,
    pub cos: f64,
    pub energy_kev: f64,
    /// Optical thickness of the layer for the scattered photon.
    pub thickness: f64,
}

impl Scattered {
    /// Probability of escape from a depth after incidence at `cos`, averaged over the azimuth.
    pub fn escape(&self, depth: f64, cos: f64) -> f64 {
        let sines = (1.0 - cos * cos).sqrt() * (1.0 - self.cos * self.cos).sqrt();
        let out = (0..AZIMUTHS).map(|azimuth| {
            let phi = TAU * (azimuth as f64 + 0.5) / AZIMUTHS as f64;
            let down = cos * self.cos + sines * phi.cos();
            let path = if down > 0.0 { 1.0 - depth } else { depth };
            (-self.thickness * path / down.abs().max(1e-9)).exp()
        });
        out.sum::<f64>() / AZIMUTHS as f64
    }
}

/// Escaping energy, relative to the incident photon.
#[derive(Default)]
pub(crate) struct Loss {
    pub energy: f64,
    /// 1 − ⟨ε²⟩/E².
    pub square: f64,
}

impl Loss {
    /// Adds the escape of a share of the energy, with a probability; the rest is deposited.
    pub fn add(&mut self, probability: f64, share: f64) {
        self.energy += probability * share;
        self.square += probability * share * (2.0 - share);
    }

    /// Adds the escape of K x-rays emitted at a depth, or of those that follow them.
    pub fn add_k_rays(&mut self, probability: f64, rays: &[KRay], depth: f64, incident_kev: f64) {
        for ray in rays {
            let sent = probability * ray.probability;
            let out = ray.escape(depth);
            self.add(sent * out, ray.energy_kev / incident_kev);
            self.add_k_rays(sent * (1.0 - out), &ray.next, depth, incident_kev);
        }
    }
}
