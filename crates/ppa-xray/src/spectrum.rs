//! Energy distribution of the photons that leave the source.

use crate::{
    cross_sections::{MAX_ENERGY_KEV, MIN_ENERGY_KEV},
    material::{Material, MaterialError},
};

/// One electronvolt-gram in joule-kilogram: keV/g to Gy.
const GRAY_PER_KEV_G: f64 = 1.602_176_634e-13;

/// Why something is not a spectrum.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SpectrumError {
    /// The tube voltage is outside the tube model.
    #[error("tube voltage {found} kV is outside the tube model, which goes from {min} to {max} kV")]
    TubeVoltage {
        /// Voltage asked for, kV.
        found: f64,
        /// Lowest voltage, kV.
        min: f64,
        /// Highest voltage, kV.
        max: f64,
    },
    /// The anode angle is outside the tube model.
    #[error("anode angle {found}° is outside the tube model, which goes from {min}° to {max}°")]
    AnodeAngle {
        /// Angle asked for, degrees.
        found: f64,
        /// Smallest angle, degrees.
        min: f64,
        /// Largest angle, degrees.
        max: f64,
    },
    /// A filter whose thickness is negative or not finite.
    #[error("filter of {material} has thickness {found_mm} mm, expected zero or more")]
    FilterThickness {
        /// Name of the filter's material.
        material: String,
        /// Thickness given, mm.
        found_mm: f64,
    },
    /// A filter that is not written as `Material:thickness`.
    #[error("cannot read filter {found:?}, expected Material:millimetres such as Al:2.5")]
    FilterSyntax {
        /// Text given.
        found: String,
    },
    /// A filter of an unknown material, or an energy outside the cross-section tables.
    #[error(transparent)]
    Material(#[from] MaterialError),
    /// Bin edges that do not ascend.
    #[error("energy bin {bin} goes from {low_kev} to {high_kev} keV, expected ascending edges")]
    Edges {
        /// Index of the bin.
        bin: usize,
        /// Its lower edge, keV.
        low_kev: f64,
        /// Its upper edge, keV.
        high_kev: f64,
    },
    /// A weight that is negative or not finite.
    #[error("energy bin {bin} has weight {found}, expected zero or more")]
    Weight {
        /// Index of the bin.
        bin: usize,
        /// Weight given.
        found: f64,
    },
    /// Photons at energies without cross sections.
    #[error(
        "the spectrum has photons between {low_kev} and {high_kev} keV, expected them from {MIN_ENERGY_KEV} to {MAX_ENERGY_KEV} keV"
    )]
    Range {
        /// Lower edge of the lowest filled bin, keV.
        low_kev: f64,
        /// Upper edge of the highest filled bin, keV.
        high_kev: f64,
    },
    /// No photon is left.
    #[error("the spectrum has no photons")]
    Dark,
    /// A file that cannot be read.
    #[error("cannot read spectrum {}", path.display())]
    Read {
        /// File at fault.
        path: std::path::PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A line of a file that is not what it should be.
    #[error("{}, line {line}: found {found:?}, expected {expected}", path.display())]
    Line {
        /// File at fault.
        path: std::path::PathBuf,
        /// Line number, from 1.
        line: usize,
        /// Text of the line.
        found: String,
        /// What belongs there.
        expected: &'static str,
    },
}

/// Photon energies in bins, uniform within each, as a probability distribution.
///
/// May know the absolute fluence: photons per mAs and cm² at 1 m from the source.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    edges_kev: Vec<f64>,
    probabilities: Vec<f64>,
    cumulative: Vec<f64>,
    /// First bin whose cumulative probability exceeds k/len.
    guide: Vec<u32>,
    fluence_per_mas_cm2_at_1m: Option<f64>,
}

impl Spectrum {
    /// Spectrum from n + 1 bin edges in keV and n weights; empty bins at both ends are dropped.
    ///
    /// # Errors
    /// Edges that do not ascend; weights that are negative or not finite, or all zero; a filled bin outside 1 to 150 keV.
    ///
    /// # Panics
    /// If there is not exactly one edge more than weights.
    pub fn from_bins(edges_kev: &[f64], weights: &[f64]) -> Result<Self, SpectrumError> {
        assert_eq!(
            edges_kev.len(),
            weights.len() + 1,
            "n bins have n + 1 edges"
        );
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

    /// All photons at one energy.
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
        // What an absorber leaves of the softest bins is zero to any detector, and may lie below the tables.
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
        let sum: f64 = weights[first..=last].iter().sum();
        let probabilities: Vec<f64> = weights[first..=last]
            .iter()
            .map(|weight| weight / sum)
            .collect();
        let mut cumulative: Vec<f64> = probabilities
            .iter()
            .scan(0.0, |sum, probability| {
                *sum += probability;
                Some(*sum)
            })
            .collect();
        *cumulative.last_mut().expect("at least one bin") = 1.0;
        let n = cumulative.len();
        let guide = (0..n)
            .map(|k| cumulative.partition_point(|&c| c <= k as f64 / n as f64) as u32)
            .collect();
        Ok(Self {
            edges_kev,
            probabilities,
            cumulative,
            guide,
            fluence_per_mas_cm2_at_1m: None,
        })
    }

    pub(crate) fn with_fluence(mut self, per_mas_cm2_at_1m: f64) -> Self {
        self.fluence_per_mas_cm2_at_1m = Some(per_mas_cm2_at_1m);
        self
    }

    /// Bin centre in keV and probability of each bin.
    pub fn bins(&self) -> impl ExactSizeIterator<Item = (f64, f64)> + '_ {
        self.edges_kev
            .windows(2)
            .map(|edges| 0.5 * (edges[0] + edges[1]))
            .zip(self.probabilities.iter().copied())
    }

    /// Edges of the bins in keV, one more than bins.
    #[must_use]
    pub fn edges_kev(&self) -> &[f64] {
        &self.edges_kev
    }

    /// Highest photon energy in keV.
    #[must_use]
    pub fn max_energy_kev(&self) -> f64 {
        self.edges_kev[self.edges_kev.len() - 1]
    }

    /// Energy in keV of the photon that `u`, uniform in [0, 1), stands for: the inverse of the cumulative distribution.
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
        self.fluence_per_mas_cm2_at_1m
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
        Some(1e6 * self.kerma_gy_cm2() * self.fluence_per_mas_cm2_at_1m?)
    }

    /// Aluminium that halves the air kerma, mm (narrow beam).
    #[must_use]
    pub fn hvl1_mm_al(&self) -> f64 {
        self.aluminium_for_kerma_fraction(0.5)
    }

    /// Aluminium that halves the air kerma once more, mm.
    #[must_use]
    pub fn hvl2_mm_al(&self) -> f64 {
        self.aluminium_for_kerma_fraction(0.25) - self.hvl1_mm_al()
    }

    /// Energy and air kerma in Gy cm² of each bin.
    fn kerma_terms(&self, air: &Material) -> Vec<(f64, f64)> {
        self.bins()
            .map(|(energy, probability)| {
                let transfer = air
                    .energy_transfer_cm2_g(energy)
                    .expect("bins lie inside the tables");
                (energy, probability * energy * transfer * GRAY_PER_KEV_G)
            })
            .collect()
    }

    /// Thickness of aluminium in mm that leaves `fraction` of the air kerma: the kerma falls steadily, so bisection finds it.
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
