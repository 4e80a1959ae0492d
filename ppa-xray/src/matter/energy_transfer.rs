//! Energy transferred to electrons by a photon field.

use crate::matter::cross_sections::{ELECTRON_REST_KEV, HC_KEV_ANGSTROM};
use crate::matter::klein_nishina::{differential, energy_ratio};
use crate::matter::material::Material;
use crate::matter::material_error::MaterialError;

/// Dose of one keV in one gram, in Gy.
pub(crate) const GRAY_PER_KEV_G: f64 = 1.602_176_634e-13;

impl Material {
    /// Kerma of one photon per cm² in keV/g, at an energy inside the tables.
    pub(crate) fn kerma_kev_cm2_g(&self, energy_kev: f64) -> f64 {
        let transfer = self.energy_transfer_cm2_g(energy_kev);
        energy_kev * transfer.expect("photons lie inside the tables")
    }

    /// Mass energy-transfer coefficient in cm²/g: the energy that a photon field transfers to electrons.
    ///
    /// Photoelectric part plus the Compton part times the mean fraction of energy transferred to the electron
    /// (Klein–Nishina × S(q)). Fluorescence counts as absorbed: correct for air and tissue, too high for metals just above their edges.
    ///
    /// # Errors
    /// An energy outside 1 to 150 keV.
    pub fn energy_transfer_cm2_g(&self, energy_kev: f64) -> Result<f64, MaterialError> {
        let sections = self.cross_sections(energy_kev)?;
        Ok(sections.photoelectric + sections.compton * self.compton_transfer_fraction(energy_kev))
    }

    /// Mean of (E − E′)/E over Klein–Nishina × S(q), by Simpson's rule in sin(θ/2), in which S is smooth.
    fn compton_transfer_fraction(&self, energy_kev: f64) -> f64 {
        const INTERVALS: usize = 64;
        let alpha = energy_kev / ELECTRON_REST_KEV;
        let (mut all, mut transferred) = (0.0, 0.0);
        for i in 0..=INTERVALS {
            let simpson = match i {
                0 | INTERVALS => 1.0,
                _ if i % 2 == 1 => 4.0,
                _ => 2.0,
            };
            let s = i as f64 / INTERVALS as f64;
            let cos = 1.0 - 2.0 * s * s;
            let weight = simpson
                * s
                * differential(energy_kev, cos)
                * self.incoherent_per_gram(s * energy_kev / HC_KEV_ANGSTROM);
            all += weight;
            transferred += weight * (1.0 - energy_ratio(alpha, cos));
        }
        transferred / all
    }
}
