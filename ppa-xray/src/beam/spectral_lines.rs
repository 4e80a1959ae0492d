//! Spectra as lines at common energies, for sums over energy.

use crate::beam::heel::Mixture;
use crate::beam::spectrum::Spectrum;
use crate::matter::energy_range::{CUTOFF_KEV, MAX_ENERGY_KEV};

/// Spectra as lines at common energies.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SpectralLines {
    /// Energies of the lines, ascending.
    pub energy_kev: Vec<f64>,
    /// Probability of every line, spectrum by spectrum.
    pub weights: Vec<Vec<f64>>,
}

impl SpectralLines {
    /// Midpoints of the energy bins; bins with less than 1e-9 of the photons, or at energies that are not
    /// followed, are omitted.
    pub fn of(spectra: &[Spectrum]) -> Self {
        let followed = |energy_kev: &f64| (CUTOFF_KEV..=MAX_ENERGY_KEV).contains(energy_kev);
        let mut energy_kev: Vec<f64> = spectra
            .iter()
            .flat_map(Spectrum::bins)
            .filter(|(energy_kev, probability)| *probability > 1e-9 && followed(energy_kev))
            .map(|(energy_kev, _)| energy_kev)
            .collect();
        energy_kev.sort_by(f64::total_cmp);
        energy_kev.dedup();
        let weights = spectra
            .iter()
            .map(|spectrum| {
                let mut weights = vec![0.0; energy_kev.len()];
                for (energy, probability) in spectrum.bins() {
                    if let Ok(line) = energy_kev.binary_search_by(|e| e.total_cmp(&energy)) {
                        weights[line] = probability;
                    }
                }
                weights
            })
            .collect();
        Self {
            energy_kev,
            weights,
        }
    }
    /// Photons per line in a mixture of two neighbouring spectra.
    #[inline]
    pub fn mixed(&self, mixture: Mixture) -> impl Iterator<Item = f64> {
        let last = self.weights.len() - 1;
        let [lower, upper] = [0, 1].map(|i| &self.weights[(mixture.lower + i).min(last)]);
        let share = mixture.upper_share;
        let both = lower.iter().zip(upper);
        both.map(move |(lower, upper)| lower + share * (upper - lower))
    }
}
