//! Quantum noise of an energy-integrating detector: a Poisson number of quanta of ⟨ε²⟩/⟨ε⟩ per layer and pixel.
//!
//! docs/physics.md, "Fast engine", noise. Swank, J. Appl. Phys. 44 (1973) 4199, for the moments of the energy.

use ppa_core::random::Philox;
use rayon::prelude::*;

use crate::detector::readout::DrawnLayer;
use crate::transport::stream::Stream;
use crate::transport::tally::Moments;

/// Expected content of the pixels of a layer.
pub(crate) struct ExpectedLayer {
    pub moments: Vec<Moments>,
    /// Expected counts of the pixels, if they differ.
    pub counted: Option<Vec<Moments>>,
    /// Squared standard error of the mean energy, keV² per history.
    pub variance_kev2: Vec<f64>,
}

/// Draws the layers in eV/cm² per history, with `ev_cm2` per keV and the noise of `histories`; infinite for no noise.
pub(crate) fn drawn(
    expected: &[ExpectedLayer; 4],
    ev_cm2: f64,
    histories: f64,
    seed: u64,
) -> [DrawnLayer; 4] {
    let noise = histories.is_finite().then(|| {
        let pixels = 0..expected[0].moments.len();
        let noise: Vec<[(f32, f32); 4]> = pixels
            .into_par_iter()
            .map(|pixel| {
                let mut rng = Philox::new(seed, Stream::QuantumNoise as u32, pixel as u64);
                expected.each_ref().map(|layer| {
                    let moments = &layer.counted.as_ref().unwrap_or(&layer.moments)[pixel];
                    let deviation = draw(moments, histories, &mut rng) - moments.mean_kev;
                    let variance = moments.square_kev2 / histories;
                    (
                        (deviation * ev_cm2) as f32,
                        (variance * ev_cm2 * ev_cm2) as f32,
                    )
                })
            })
            .collect();
        noise
    });
    [0, 1, 2, 3].map(|layer| {
        let ExpectedLayer {
            moments,
            variance_kev2,
            ..
        } = &expected[layer];
        let sigmas = variance_kev2.iter().map(|variance| variance.sqrt());
        DrawnLayer {
            expected: moments
                .iter()
                .map(|m| (m.mean_kev * ev_cm2) as f32)
                .collect(),
            shared_sigma: sigmas.map(|sigma| (sigma * ev_cm2) as f32).collect(),
            noise: noise.as_ref().map(|noise| {
                let (deviation, variance) = noise.iter().map(|pixel| pixel[layer]).unzip();
                [deviation, variance]
            }),
        }
    })
}

/// Samples the mean energy per history, keV, that `histories` photons would have deposited.
///
/// The energy in a pixel is compound Poisson: N photons on average, each counted with its energy, so
/// mean N⟨E⟩ and variance N⟨E²⟩ (Swank, J. Appl. Phys. 44 (1973) 4199). A Poisson number of quanta, each of energy
/// ⟨E²⟩/⟨E⟩, has the same mean and variance and is never negative.
pub(crate) fn draw(expected: &Moments, histories: f64, rng: &mut Philox) -> f64 {
    if expected.mean_kev <= 0.0 {
        return 0.0;
    }
    let quantum_kev = expected.square_kev2 / expected.mean_kev;
    let quanta = histories * expected.mean_kev / quantum_kev;
    poisson(quanta, rng) * quantum_kev / histories
}

/// Samples a Poisson number with the given mean.
fn poisson(mean: f64, rng: &mut Philox) -> f64 {
    if mean < 10.0 {
        multiplication(mean, rng)
    } else {
        transformed_rejection(mean, rng)
    }
}

/// Counts uniform factors until their product falls below exp(−mean) (Knuth).
fn multiplication(mean: f64, rng: &mut Philox) -> f64 {
    let limit = (-mean).exp();
    let mut count = 0.0;
    let mut product = rng.unit();
    while product > limit {
        count += 1.0;
        product *= rng.unit();
    }
    count
}

/// Algorithm PTRS of Hörmann, Insurance: Mathematics and Economics 12 (1993) 39; mean ≥ 10.
fn transformed_rejection(mean: f64, rng: &mut Philox) -> f64 {
    let b = 0.931 + 2.53 * mean.sqrt();
    let a = -0.059 + 0.024_83 * b;
    let inverse_alpha = 1.123_9 + 1.132_8 / (b - 3.4);
    let v_r = 0.927_7 - 3.622_4 / (b - 2.0);
    let ln_mean = mean.ln();
    loop {
        let u = rng.unit() - 0.5;
        // 1 − u is in (0, 1], so the logarithm below stays finite.
        let v = 1.0 - rng.unit();
        let us = 0.5 - u.abs();
        let k = ((2.0 * a / us + b) * u + mean + 0.43).floor();
        if us >= 0.07 && v <= v_r {
            return k;
        }
        if k < 0.0 || (us < 0.013 && v > us) {
            continue;
        }
        let bound = k * ln_mean - mean - ln_factorial(k);
        if (v * inverse_alpha / (a / (us * us) + b)).ln() <= bound {
            return k;
        }
    }
}

/// ln k! by Stirling's series; the first neglected term is below 1e-12 from k = 16 on.
fn ln_factorial(k: f64) -> f64 {
    if k < 16.0 {
        return (2..=k as u64).map(|i| (i as f64).ln()).sum();
    }
    let x = k + 1.0;
    let series = (1.0 / 12.0
        - (1.0 / 360.0 - (1.0 / 1260.0 - 1.0 / (1680.0 * x * x)) / (x * x)) / (x * x))
        / x;
    (x - 0.5) * x.ln() - x + 0.5 * (std::f64::consts::TAU).ln() + series
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean and variance of the samples against N⟨E⟩ and N⟨E²⟩, for few and many quanta.
    #[test]
    fn noise_has_mean_and_variance_of_compound_poisson() {
        let expected = Moments {
            mean_kev: 3e-4,
            square_kev2: 1.2e-2,
        };
        let draws = 40_000_u32;
        for histories in [1e3, 1e5, 5e6, 2e10] {
            let values: Vec<f64> = (0..draws)
                .map(|i| draw(&expected, histories, &mut Philox::new(5, 1, u64::from(i))))
                .collect();
            let n = f64::from(draws);
            let mean = values.iter().sum::<f64>() / n;
            let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
            let true_variance = expected.square_kev2 / histories;
            let z = (mean - expected.mean_kev) / (true_variance / n).sqrt();
            assert!(z.abs() < 4.5, "mean at {histories}: z = {z}"); // 7e-6 each
            // Kurtosis of a Poisson number: 3 + 1/quanta.
            let quanta = histories * expected.mean_kev.powi(2) / expected.square_kev2;
            let spread = true_variance * ((2.0 + 1.0 / quanta) / n).sqrt();
            let z = (variance - true_variance) / spread;
            assert!(z.abs() < 5.0, "variance at {histories}: z = {z}");
        }
    }

    /// The full distribution at a mean where rejection has just taken over; chi² with 21 classes.
    #[test]
    fn poisson_numbers_follow_their_distribution() {
        let (mean, draws) = (12.0_f64, 100_000_u32);
        let mut found = [0.0_f64; 22];
        for i in 0..draws {
            let k = poisson(mean, &mut Philox::new(9, 1, u64::from(i)));
            found[((k - 2.0).max(0.0) as usize).min(21)] += 1.0;
        }
        let probability = |k: f64| (k * mean.ln() - mean - ln_factorial(k)).exp();
        let mut chi2 = 0.0;
        for (class, &count) in found.iter().enumerate() {
            let k = class as f64 + 2.0;
            let p = match class {
                0 => probability(0.0) + probability(1.0) + probability(2.0),
                21 => (23..60).map(|k| probability(f64::from(k))).sum(),
                _ => probability(k),
            };
            let expected = p * f64::from(draws);
            chi2 += (count - expected).powi(2) / expected;
        }
        assert!(chi2 < 56.0, "chi² = {chi2} with 21 degrees of freedom"); // 5e-5
    }
}
