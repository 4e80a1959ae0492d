//! Energies of photons on their way to a collision.

use crate::beam::spectrum::Spectrum;
use crate::engine::attenuation_basis::LANES;
use crate::engine::paths::Paths;
use crate::transport::attenuation::{CEILING_KEV, CUTOFF_KEV};

/// Share that soft photons keep however much lies in their way.
const LEAST: f64 = 1e-3;

/// Draws energies as photons have them that get through a given mass, with weights that restore the spectrum.
#[derive(Debug)]
pub(crate) struct EnergySampler {
    bins: Vec<EnergyBin>,
}

#[derive(Debug)]
struct EnergyBin {
    low_kev: f64,
    width_kev: f64,
    cumulative: f64,
    /// Probability in the spectrum over probability of being drawn.
    photons: f64,
}

impl EnergySampler {
    pub fn new(spectrum: &Spectrum, paths: &Paths, mass: &[[f32; LANES]]) -> Self {
        let followed = |energy_kev: f64| (CUTOFF_KEV..=CEILING_KEV).contains(&energy_kev);
        let through: Vec<f64> = spectrum
            .bins()
            .map(|(energy_kev, probability)| {
                let exponent = f64::from(paths.basis.exponent(mass, energy_kev));
                probability * ((-exponent).exp() + LEAST)
            })
            .collect();
        let kept = || {
            spectrum
                .bins()
                .zip(spectrum.edges_kev().windows(2))
                .zip(&through)
                .filter(|(((energy_kev, _), _), through)| followed(*energy_kev) && **through > 0.0)
        };
        let sum: f64 = kept().map(|(_, through)| through).sum();
        let mut cumulative = 0.0;
        let bins = kept()
            .map(|(((_, probability), edges), through)| {
                cumulative += through / sum;
                EnergyBin {
                    low_kev: edges[0],
                    width_kev: edges[1] - edges[0],
                    cumulative,
                    photons: probability * sum / through,
                }
            })
            .collect();
        Self { bins }
    }

    /// Energy and weight that `u`, uniform in [0, 1), stands for.
    #[inline]
    pub fn draw(&self, u: f64) -> (f64, f64) {
        let index = self
            .bins
            .partition_point(|bin| bin.cumulative <= u)
            .min(self.bins.len() - 1);
        let bin = &self.bins[index];
        let below = if index == 0 {
            0.0
        } else {
            self.bins[index - 1].cumulative
        };
        let inside = ((u - below) / (bin.cumulative - below)).clamp(0.0, 1.0);
        (bin.low_kev + inside * bin.width_kev, bin.photons)
    }
}
