//! Compton scattering: Klein–Nishina times the incoherent scattering function S(q).
//!
//! The scattered energy is that of a free electron at rest; Doppler broadening by the electron's motion is not modelled yet.

use crate::{
    matter::cross_sections::{ELECTRON_REST_KEV, HC_KEV_ANGSTROM},
    matter::material::Material,
    octaves::Octaves,
    philox::Philox,
};

/// E′/E = 1 / (1 + α (1 − cos θ)), α = E / mₑc² (Compton 1923, doi:10.1103/PhysRev.21.483).
#[inline]
pub(crate) fn energy_ratio(alpha: f64, cos_theta: f64) -> f64 {
    1.0 / (1.0 + alpha * (1.0 - cos_theta))
}

/// Sampler of Compton scattering in one material.
#[derive(Clone, Debug)]
pub(crate) struct Compton {
    /// S of the material over x = q², relative, never decreasing.
    incoherent: Vec<f32>,
    grid: Octaves,
}

impl Compton {
    pub(crate) fn new(material: &Material, grid: Octaves) -> Self {
        let mut largest = 0.0_f64;
        let incoherent = grid
            .nodes()
            .map(|x| {
                largest = largest.max(material.incoherent_per_gram(x.sqrt()));
                largest as f32
            })
            .collect();
        Self { incoherent, grid }
    }

    /// S at x = q², up to a constant.
    #[inline]
    fn incoherent_at(&self, x: f64) -> f64 {
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

    /// Cosine of the scattering angle and energy of the scattered photon in keV.
    ///
    /// Rejection from the uniform cosine: ½ τ² (τ + 1/τ − sin²θ) ≤ 1 and S ≤ S(backwards).
    #[inline]
    pub(crate) fn sample(&self, energy_kev: f64, random: &mut Philox) -> (f64, f64) {
        let alpha = energy_kev * (1.0 / ELECTRON_REST_KEV);
        let x_backwards = (energy_kev * (1.0 / HC_KEV_ANGSTROM)).powi(2);
        let bound = 2.0 * self.incoherent_at(x_backwards);
        loop {
            let half = random.unit(); // (1 − cos θ)/2
            let cos = 1.0 - 2.0 * half;
            let ratio = energy_ratio(alpha, cos);
            let klein_nishina = ratio * (1.0 + ratio * (ratio - 1.0 + cos * cos));
            let threshold = random.unit() * bound;
            // S never exceeds its backward value: most rejections need no look-up.
            if threshold < 0.5 * bound * klein_nishina
                && threshold < klein_nishina * self.incoherent_at(x_backwards * half)
            {
                return (cos, energy_kev * ratio);
            }
        }
    }
}
