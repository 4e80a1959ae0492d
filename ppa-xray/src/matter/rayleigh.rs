//! Rayleigh scattering: Thomson's law times the squared form factor.

use crate::{
    matter::cross_sections::HC_KEV_ANGSTROM,
    matter::energy_range::{MAX_ENERGY_KEV, MIN_ENERGY_KEV},
    matter::form_factors::FormFactors,
    matter::material::Material,
    octaves::Octaves,
};

/// Quantile bins per octave of the tail probability, as a power of two: for free atoms, and for measured form factors with
/// their peaks.
const TAIL_BITS: u32 = 6;
const TAIL_BITS_OF_PEAKS: u32 = 8;
/// Energy bins per octave, as a power of two.
const ENERGY_BITS: u32 = 5;
/// Integration steps per octave of q², as a power of two.
const Q_SQUARED_BITS: u32 = 5;
/// Smallest q² of the integration in 1/Å²: F² is constant below.
const MIN_Q_SQUARED: f64 = 1e-5;

/// Sampler of Rayleigh scattering in one material.
///
/// With x = q², q = sin(θ/2) E/hc, the distribution is F²(x) dx · (1 + cos²θ)/2: x from the inverse of the
/// cumulative ∫F² dx up to its backward value, then rejection (Baró et al. 1994, doi:10.1016/0969-806X(94)90083-3).
/// One inverse serves all energies: x as a function of the share of ∫F² dx beyond it, on a grid of octaves, since F² ends in a power law.
#[derive(Clone, Debug)]
pub(crate) struct Rayleigh {
    /// x in 1/Å² by the share beyond it, linear between the nodes.
    quantiles: Vec<f32>,
    /// Bits of the first tail share, shifted.
    first_tail: u32,
    /// Bits of a tail share below its bin.
    tail_shift: u32,
    /// Share of ∫F² dx beyond backward scattering, by energy.
    beyond_backward: Vec<f32>,
    energies: Octaves,
}

impl Rayleigh {
    pub(crate) fn new(material: &Material) -> Self {
        let largest = (MAX_ENERGY_KEV / HC_KEV_ANGSTROM).powi(2);
        let grid = Octaves::covering(MIN_Q_SQUARED, 2.0 * largest, Q_SQUARED_BITS);
        let x: Vec<f64> = std::iter::once(0.0).chain(grid.nodes()).collect();
        let squared: Vec<f64> = x
            .iter()
            .map(|x| material.form_factor_squared_per_gram(x.sqrt()))
            .collect();
        // Tail beyond each node, from the far end inwards.
        let mut tail = vec![0.0; x.len()];
        for i in (0..x.len() - 1).rev() {
            tail[i] = tail[i + 1] + 0.5 * (squared[i] + squared[i + 1]) * (x[i + 1] - x[i]);
        }
        let whole = tail[0];
        for tail in &mut tail {
            *tail /= whole;
        }
        let cumulative = Cumulative {
            x,
            squared,
            tail,
            whole,
        };
        let energies = Octaves::covering(MIN_ENERGY_KEV, MAX_ENERGY_KEV, ENERGY_BITS);
        let backward = |energy: f64| (energy / HC_KEV_ANGSTROM).powi(2);
        let beyond_backward: Vec<f32> = energies
            .nodes()
            .map(|energy| cumulative.tail_at(backward(energy)) as f32)
            .collect();
        let smallest = f64::from(beyond_backward[beyond_backward.len() - 1]);
        let tail_bits = match material.form_factors() {
            FormFactors::IndependentAtoms => TAIL_BITS,
            FormFactors::Molecular => TAIL_BITS_OF_PEAKS,
        };
        let tail_shift = f32::MANTISSA_DIGITS - 1 - tail_bits;
        let shares = Octaves::covering(smallest, 1.0, tail_bits);
        let quantiles: Vec<f32> = shares
            .nodes()
            .map(|share| cumulative.x_at(share.min(1.0)) as f32)
            .collect();
        Self {
            quantiles,
            first_tail: (shares.first() as f32).to_bits() >> tail_shift,
            tail_shift,
            beyond_backward,
            energies,
        }
    }

    /// Samples sin²(θ/2) of a scattered photon.
    #[inline]
    pub(crate) fn sample(&self, energy_kev: f32, mut uniform: impl FnMut() -> f32) -> f32 {
        let (bin, fraction) = self.energies.locate(f64::from(energy_kev));
        let [low, high] = [bin, bin + 1].map(|i| self.beyond_backward[i]);
        let within = 1.0 - (low + fraction as f32 * (high - low));
        let wavelength = HC_KEV_ANGSTROM as f32 / energy_kev;
        let per_x = wavelength * wavelength;
        loop {
            let sin2_half_theta = (self.x(1.0 - uniform() * within) * per_x).min(1.0);
            let cos = 1.0 - 2.0 * sin2_half_theta;
            if 2.0 * uniform() < 1.0 + cos * cos {
                return sin2_half_theta;
            }
        }
    }

    /// x beyond which the share of ∫F² dx is `tail`.
    #[inline(always)]
    fn x(&self, tail: f32) -> f32 {
        let width = 1 << self.tail_shift;
        let bin = (tail.to_bits() >> self.tail_shift).wrapping_sub(self.first_tail) as usize;
        let bin = bin.min(self.quantiles.len() - 2);
        let into = (tail.to_bits() & (width - 1)) as f32 / width as f32;
        let [low, high] = [bin, bin + 1].map(|i| self.quantiles[i]);
        low + into * (high - low)
    }
}

/// F² linear in x between nodes, and the share of its integral beyond each.
struct Cumulative {
    x: Vec<f64>,
    squared: Vec<f64>,
    tail: Vec<f64>,
    whole: f64,
}

impl Cumulative {
    fn tail_at(&self, x: f64) -> f64 {
        let upper = self
            .x
            .partition_point(|&node| node <= x)
            .clamp(1, self.x.len() - 1);
        let (d, width) = (self.x[upper] - x, self.x[upper] - self.x[upper - 1]);
        let slope = (self.squared[upper - 1] - self.squared[upper]) / width;
        self.tail[upper] + d * (self.squared[upper] + 0.5 * slope * d) / self.whole
    }

    fn x_at(&self, tail: f64) -> f64 {
        let upper = self
            .tail
            .partition_point(|&node| node > tail)
            .clamp(1, self.x.len() - 1);
        let rest = (tail - self.tail[upper]) * self.whole;
        let width = self.x[upper] - self.x[upper - 1];
        let slope = (self.squared[upper - 1] - self.squared[upper]) / width;
        let last = self.squared[upper];
        // Root of F² d + ½ slope d² = rest, in a form without cancellation.
        let root = (last * last + 2.0 * slope * rest).max(0.0).sqrt();
        self.x[upper]
            - if rest > 0.0 {
                2.0 * rest / (last + root)
            } else {
                0.0
            }
    }
}
