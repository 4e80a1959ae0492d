//! Energy distribution of the photons that leave the source.

use crate::{
    beam::spectrum_error::SpectrumError,
    beam::tube::TubeSpec,
    matter::energy_range::{MAX_ENERGY_KEV, MIN_ENERGY_KEV},
    matter::energy_transfer::GRAY_PER_KEV_G,
    matter::material::Material,
};

/// Entries per bin of the table that gives the first bin to search; the first is nearly always right.
const GUIDE_PER_BIN: usize = 16;

/// Photon energies in bins, uniform within each, as a probability distribution.
///
/// May have an absolute fluence: photons per mAs and cm² at 1 m from the source.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    edges_kev: Vec<f64>,
    probabilities: Vec<f64>,
    cumulative: Vec<f64>,
    /// First bin whose cumulative probability exceeds k/len.
    guide: Vec<u32>,
    /// The source tube, and its photons per mAs and cm² at 1 m.
    tube: Option<(TubeSpec, f64)>,
}

impl Spectrum {
    /// Builds a spectrum from n + 1 bin edges in keV and n weights. Empty bins at both ends are dropped.
    ///
    /// # Errors
    /// A number of edges that is not the number of weights plus one; edges that do not ascend; weights that are negative, not finite
    /// or all zero; a filled bin outside 1 to 150 keV.
    pub fn from_bins(edges_kev: &[f64], weights: &[f64]) -> Result<Self, SpectrumError> {
        if edges_kev.len() != weights.len() + 1 {
            return Err(SpectrumError::Count {
                edges: edges_kev.len(),
                weights: weights.len(),
            });
        }
        for (bin, (edges, &weight)) in edges_kev.windows(2).zip(weights).enumerate() {
            if edges[0].partial_cmp(&edges[1]) != Some(std::cmp::Ordering::Less)
                || !edges[1].is_finite()
            {
                return Err(SpectrumError::Edges {
                    bin,
                    low_kev: edges[0],
                    high_kev: edges[1],
                });
            }
            if !(weight.is_finite() && weight >= 0.0) {
                return Err(SpectrumError::Weight { bin, found: weight });
            }
        }
        Self::from_checked_bins(edges_kev, weights)
    }

    /// A spectrum of one photon energy.
    ///
    /// # Errors
    /// An energy outside 1 to 150 keV.
    pub fn monoenergetic(energy_kev: f64) -> Result<Self, SpectrumError> {
        if energy_kev.is_nan() {
            return Err(SpectrumError::Range {
                low_kev: energy_kev,
                high_kev: energy_kev,
            });
        }
        Self::from_checked_bins(&[energy_kev; 2], &[1.0])
    }

    fn from_checked_bins(edges_kev: &[f64], weights: &[f64]) -> Result<Self, SpectrumError> {
        let largest = weights.iter().copied().fold(0.0, f64::max);
        // The softest bins behind an absorber are zero to any detector, and may be below the tables.
        let filled = |weight: &f64| *weight > largest * 1e-30;
        let first = weights.iter().position(filled).ok_or(SpectrumError::Dark)?;
        let last = weights
            .iter()
            .rposition(filled)
            .ok_or(SpectrumError::Dark)?;
        let edges_kev = edges_kev[first..=last + 1].to_vec();
        let (low_kev, high_kev) = (edges_kev[0], edges_kev[last - first + 1]);
        if low_kev < MIN_ENERGY_KEV || high_kev > MAX_ENERGY_KEV {
            return Err(SpectrumError::Range { low_kev, high_kev });
        }
        // Scaled by the largest so that the sum stays finite.
        let relative: Vec<f64> = weights[first..=last]
            .iter()
            .map(|weight| weight / largest)
            .collect();
        let sum: f64 = relative.iter().sum();
        let probabilities: Vec<f64> = relative.iter().map(|weight| weight / sum).collect();
        let mut cumulative: Vec<f64> = probabilities
            .iter()
            .scan(0.0, |sum, probability| {
                *sum += probability;
                Some(*sum)
            })
            .collect();
        *cumulative.last_mut().expect("at least one bin") = 1.0;
        let n = GUIDE_PER_BIN * cumulative.len();
        let guide = (0..n)
            .map(|k| cumulative.partition_point(|&c| c <= k as f64 / n as f64) as u32)
            .collect();
        Ok(Self {
            edges_kev,
            probabilities,
            cumulative,
            guide,
            tube: None,
        })
    }

    pub(crate) fn of_tube(mut self, tube: &TubeSpec, fluence_per_mas_cm2_at_1m: f64) -> Self {
        self.tube = Some((tube.clone(), fluence_per_mas_cm2_at_1m));
        self
    }

    /// The tube that the spectrum was computed for, if it came from the tube model.
    #[must_use]
    pub fn tube(&self) -> Option<&TubeSpec> {
        self.tube.as_ref().map(|(tube, _)| tube)
    }

    /// Bin centre in keV and probability of each bin.
    pub fn bins(&self) -> impl ExactSizeIterator<Item = (f64, f64)> + '_ {
        self.edges_kev
            .windows(2)
            .map(|edges| 0.5 * (edges[0] + edges[1]))
            .zip(self.probabilities.iter().copied())
    }

    /// Edges of the bins in keV, one more than there are bins.
    #[must_use]
    pub fn edges_kev(&self) -> &[f64] {
        &self.edges_kev
    }

    /// Highest photon energy in keV.
    #[must_use]
    pub fn max_energy_kev(&self) -> f64 {
        self.edges_kev[self.edges_kev.len() - 1]
    }

    /// Energy in keV at the cumulative probability `u`, uniform in [0, 1): the inverse of the cumulative distribution.
    #[inline]
    #[must_use]
    pub fn sample(&self, u: f64) -> f64 {
        let mut bin =
            self.guide[((u * self.guide.len() as f64) as usize).min(self.guide.len() - 1)] as usize;
        while self.cumulative[bin] <= u && bin + 1 < self.cumulative.len() {
            bin += 1;
        }
        let below = self.cumulative[bin] - self.probabilities[bin];
        let inside = ((u - below) / self.probabilities[bin]).clamp(0.0, 1.0);
        self.edges_kev[bin] + inside * (self.edges_kev[bin + 1] - self.edges_kev[bin])
    }

    /// Mean photon energy in keV.
    #[must_use]
    pub fn mean_energy_kev(&self) -> f64 {
        self.bins()
            .map(|(energy, probability)| energy * probability)
            .sum()
    }

    /// Photons per mAs and cm² at 1 m from the source, if the spectrum came from the tube model.
    #[must_use]
    pub fn fluence_per_mas_cm2_at_1m(&self) -> Option<f64> {
        self.tube.as_ref().map(|&(_, fluence)| fluence)
    }

    /// Air kerma of one photon per cm² in Gy.
    #[must_use]
    pub fn kerma_gy_cm2(&self) -> f64 {
        self.kerma_terms(&named("air"))
            .iter()
            .map(|(_, kerma)| kerma)
            .sum()
    }

    /// Air kerma in µGy per mAs at 1 m from the source, if the spectrum came from the tube model.
    #[must_use]
    pub fn kerma_ugy_per_mas_at_1m(&self) -> Option<f64> {
        Some(1e6 * self.kerma_gy_cm2() * self.fluence_per_mas_cm2_at_1m()?)
    }

    /// First half-value layer: thickness of aluminium that halves the air kerma, mm (narrow beam).
    #[must_use]
    pub fn hvl1_mm_al(&self) -> f64 {
        self.aluminium_for_kerma_fraction(0.5)
    }

    /// Second half-value layer: thickness of aluminium that halves the air kerma once more, mm.
    #[must_use]
    pub fn hvl2_mm_al(&self) -> f64 {
        self.aluminium_for_kerma_fraction(0.25) - self.hvl1_mm_al()
    }

    /// Energy and air kerma in Gy cm² of each bin.
    fn kerma_terms(&self, air: &Material) -> Vec<(f64, f64)> {
        self.bins()
            .map(|(energy, probability)| {
                let kerma_gy_cm2 = air.kerma_kev_cm2_g(energy) * GRAY_PER_KEV_G;
                (energy, probability * kerma_gy_cm2)
            })
            .collect()
    }

    /// Thickness of aluminium in mm that leaves `fraction` of the air kerma. The kerma falls monotonically, so bisection finds it.
    fn aluminium_for_kerma_fraction(&self, fraction: f64) -> f64 {
        let aluminium = named("aluminium");
        let terms: Vec<(f64, f64)> = self
            .kerma_terms(&named("air"))
            .into_iter()
            .map(|(energy, kerma)| {
                let total = aluminium
                    .total_cm2_g(energy)
                    .expect("bins lie inside the tables");
                (total * aluminium.density_g_cm3() / 10.0, kerma) // 1/cm → 1/mm
            })
            .collect();
        let behind = |mm: f64| {
            terms
                .iter()
                .map(|(mu, kerma)| kerma * (-mu * mm).exp())
                .sum::<f64>()
        };
        let target = fraction * behind(0.0);
        let (mut low, mut high) = (0.0, 1.0);
        while behind(high) > target {
            high *= 2.0;
        }
        while high - low > 1e-9 * high {
            let middle = 0.5 * (low + high);
            if behind(middle) > target {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    }
}

fn named(material: &str) -> Material {
    Material::named(material).expect("in the library")
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// The sampler inverts the cumulative distribution, whatever the weights.
        #[test]
        fn sampling_inverts_the_cumulative_distribution(
            weights in prop::collection::vec(prop_oneof![Just(0.0), 1e-9..1e300_f64], 1..40),
            u in 0.0..1.0_f64,
        ) {
            prop_assume!(weights.iter().any(|&weight| weight > 0.0));
            let edges: Vec<f64> = (0..=weights.len()).map(|i| 10.0 + 0.5 * i as f64).collect();
            let spectrum = Spectrum::from_bins(&edges, &weights).unwrap();
            let energy = spectrum.sample(u);
            let below: f64 = spectrum
                .edges_kev()
                .windows(2)
                .zip(spectrum.bins())
                .map(|(edges, (_, p))| p * ((energy - edges[0]) / (edges[1] - edges[0])).clamp(0.0, 1.0))
                .sum();
            prop_assert!((below - u).abs() < 1e-9, "{below} of the photons below {energy} keV, expected {u}");
        }
    }

    /// Narrow-beam attenuation of one energy is exponential: HVL = ln 2/μ, and the second is the first.
    #[test]
    fn one_energy_has_the_hvl_of_its_attenuation() {
        let spectrum = Spectrum::monoenergetic(60.0).unwrap();
        let aluminium = named("aluminium");
        let mu_per_mm = aluminium.total_cm2_g(60.0).unwrap() * aluminium.density_g_cm3() / 10.0;
        let hvl_mm = std::f64::consts::LN_2 / mu_per_mm;
        assert!((spectrum.hvl1_mm_al() / hvl_mm - 1.0).abs() < 1e-8);
        assert!((spectrum.hvl2_mm_al() / hvl_mm - 1.0).abs() < 1e-8);
        assert_eq!(spectrum.sample(0.7), 60.0);
        assert!(matches!(
            Spectrum::monoenergetic(0.5),
            Err(SpectrumError::Range { .. })
        ));
    }

    /// E μ_en/ρ with μ_en/ρ = 0.03041 cm²/g at 60 keV in dry air (NISTIR 5632).
    #[test]
    fn kerma_agrees_with_the_energy_absorption_of_nist() {
        let kerma = Spectrum::monoenergetic(60.0).unwrap().kerma_gy_cm2();
        assert!(
            (kerma / (60.0 * 0.03041 * GRAY_PER_KEV_G) - 1.0).abs() < 0.01,
            "{kerma:e}"
        );
    }
}
