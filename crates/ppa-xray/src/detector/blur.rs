//! Blur of a converter by its modulation transfer function.

use std::f64::consts::{PI, TAU};

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::detector::receptor::{Blur, ReceptorError, require};

/// A blur as a sum of Gaussians, each of which acts on rows and columns one after the other.
///
/// Any MTF that falls as converters' do is one: 1/(1 + H f²) is ∫ exp(−t) exp(−t H f²) dt. Weights are positive and sum
/// to 1, so that the signal is kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct GaussianSum {
    /// Weight and standard deviation in pixels.
    terms: Vec<(f64, f64)>,
}

/// Largest difference between an MTF and its sum of Gaussians that passes.
const WORST_FIT: f64 = 0.03;

impl GaussianSum {
    /// Fits the sum up to √2 times the Nyquist frequency, the corner of the plane of frequencies.
    ///
    /// # Errors
    /// [`ReceptorError`] for numbers that make no sense, and for a curve that no sum of Gaussians follows within 0.03.
    pub fn of(blur: &Blur, pixel_mm: f64) -> Result<Self, ReceptorError> {
        let corner_per_mm = std::f64::consts::FRAC_1_SQRT_2 / pixel_mm;
        let curve: Vec<(f64, f64)> = match blur {
            Blur::Lorentzian { h_mm2 } => {
                let expected = "1e-6 to 1000 mm²";
                require("H of the MTF 1/(1 + H f²)", *h_mm2, 1e-6..=1e3, expected)?;
                let points = (0..=32).map(|i| corner_per_mm * f64::from(i) / 32.0);
                points.map(|f| (f, 1.0 / (1.0 + h_mm2 * f * f))).collect()
            }
            Blur::Mtf { per_mm, mtf } => table(per_mm, mtf, corner_per_mm)?,
        };
        let sigma_mm = |i: i32| pixel_mm * 0.05 * 1.35_f64.powi(i);
        let basis: Vec<f64> = std::iter::once(0.0).chain((0..24).map(sigma_mm)).collect();
        let weights = fit(&curve, &basis);
        let sum: f64 = weights.iter().sum();
        for &(f, expected) in &curve {
            let parts = weights.iter().zip(&basis);
            let found = parts.map(|(w, sigma)| w / sum * gaussian_mtf(*sigma, f));
            let found: f64 = found.sum();
            if (found - expected).abs() > WORST_FIT {
                return Err(ReceptorError::Mtf {
                    per_mm: f,
                    found: expected,
                    nearest: found,
                });
            }
        }
        let terms = weights.iter().zip(&basis);
        let terms = terms
            .filter(|(weight, _)| **weight > 1e-6 * sum)
            .map(|(weight, sigma)| (weight / sum, sigma / pixel_mm));
        Ok(Self {
            terms: terms.collect(),
        })
    }

    /// Σ h² of the blur's kernel: what it leaves of the variance of white noise.
    pub fn noise_gain(&self) -> f64 {
        let kernels: Vec<(f64, Vec<f64>)> = self
            .terms
            .iter()
            .map(|&(weight, sigma)| (weight, kernel(sigma)))
            .collect();
        let mut sum = 0.0;
        for (first, a) in &kernels {
            for (second, b) in &kernels {
                let both: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                let line = 2.0 * both - a[0] * b[0];
                sum += first * second * line * line;
            }
        }
        sum
    }

    /// Blurs a row-major plane; beyond its edges it goes on as its mirror image, so that the sum is kept.
    pub fn apply(&self, plane: &[f32], columns: usize) -> Vec<f32> {
        let rows = plane.len() / columns;
        let mut sum = vec![0.0_f32; plane.len()];
        for &(weight, sigma) in &self.terms {
            let kernel: Vec<f32> = kernel(sigma).iter().map(|&k| k as f32).collect();
            let mut across = vec![0.0_f32; plane.len()];
            across
                .par_chunks_mut(columns)
                .zip(plane.par_chunks(columns))
                .for_each(|(to, from)| {
                    for (column, to) in to.iter_mut().enumerate() {
                        *to = at_mirrored(from.len(), column, &kernel, |i| from[i]);
                    }
                });
            let weight = weight as f32;
            sum.par_chunks_mut(columns)
                .enumerate()
                .for_each(|(row, to)| {
                    let mut add = |factor: f32, from: usize| {
                        let from = &across[from * columns..][..columns];
                        for (to, from) in to.iter_mut().zip(from) {
                            *to += factor * from;
                        }
                    };
                    add(weight * kernel[0], row);
                    for (n, &k) in kernel.iter().enumerate().skip(1) {
                        add(weight * k, mirrored(row as isize - n as isize, rows));
                        add(weight * k, mirrored(row as isize + n as isize, rows));
                    }
                });
        }
        sum
    }
}

fn at_mirrored(len: usize, at: usize, kernel: &[f32], value: impl Fn(usize) -> f32) -> f32 {
    let mut sum = kernel[0] * value(at);
    let reach = kernel.len() - 1;
    if at >= reach && at + reach < len {
        for (n, k) in kernel.iter().enumerate().skip(1) {
            sum += k * (value(at - n) + value(at + n));
        }
    } else {
        for (n, k) in kernel.iter().enumerate().skip(1) {
            let left = mirrored(at as isize - n as isize, len);
            let right = mirrored(at as isize + n as isize, len);
            sum += k * (value(left) + value(right));
        }
    }
    sum
}

/// Index inside 0..len after reflection at both ends, as often as it takes.
fn mirrored(index: isize, len: usize) -> usize {
    let period = 2 * len as isize;
    let folded = index.rem_euclid(period);
    folded.min(period - 1 - folded) as usize
}

/// exp(−2π²σ²f²).
fn gaussian_mtf(sigma: f64, f: f64) -> f64 {
    (-2.0 * (PI * sigma * f).powi(2)).exp()
}

/// Half of the symmetric kernel whose transfer function is that of a Gaussian up to the Nyquist frequency, σ in pixels.
///
/// Samples of a Gaussian narrower than a pixel would not be: their transfer function comes back at Nyquist.
fn kernel(sigma: f64) -> Vec<f64> {
    const POINTS: usize = 256;
    let reach = if sigma == 0.0 {
        0
    } else {
        (5.0 * sigma).ceil().max(8.0) as usize
    };
    let mut half: Vec<f64> = (0..=reach)
        .map(|n| {
            let points = (0..POINTS).map(|i| 0.5 * (i as f64 + 0.5) / POINTS as f64);
            let sum: f64 = points
                .map(|f| gaussian_mtf(sigma, f) * (TAU * f * n as f64).cos())
                .sum();
            sum / POINTS as f64
        })
        .collect();
    let sum = half[0] + 2.0 * half[1..].iter().sum::<f64>();
    half.iter_mut().for_each(|k| *k /= sum);
    half
}

/// A measured curve, checked, with (0, 1) in front and without what lies beyond the corner.
fn table(
    per_mm: &[f64],
    mtf: &[f64],
    corner_per_mm: f64,
) -> Result<Vec<(f64, f64)>, ReceptorError> {
    if per_mm.len() != mtf.len() || per_mm.is_empty() {
        return Err(ReceptorError::MtfTable {
            frequencies: per_mm.len(),
            values: mtf.len(),
        });
    }
    let mut curve = vec![(0.0_f64, 1.0_f64)];
    for (&f, &value) in per_mm.iter().zip(mtf) {
        let last = curve[curve.len() - 1].0;
        if f == 0.0 && curve.len() == 1 {
            require("the MTF at 0/mm", value, 1.0..=1.0, "1")?;
            continue;
        }
        let above = "above the frequency before it";
        require(
            "a frequency of the MTF table in 1/mm",
            f,
            last.next_up()..=f64::MAX,
            above,
        )?;
        require("a value of the MTF table", value, 0.0..=1.0, "0 to 1")?;
        curve.push((f, value));
    }
    // One point beyond the corner is kept, so that the fit knows where the curve goes.
    let inside = curve.partition_point(|&(f, _)| f <= corner_per_mm);
    curve.truncate(inside + 1);
    Ok(curve)
}

/// Non-negative least squares by an active set (Lawson and Hanson, Solving Least Squares Problems, 1974, chapter 23).
///
/// The value at frequency 0 weighs heavily, so that the weights sum to about 1.
fn fit(curve: &[(f64, f64)], basis: &[f64]) -> Vec<f64> {
    const EMPHASIS: f64 = 30.0;
    let emphasis = |f: f64| if f == 0.0 { EMPHASIS } else { 1.0 };
    let matrix = DMatrix::from_fn(curve.len(), basis.len(), |row, column| {
        emphasis(curve[row].0) * gaussian_mtf(basis[column], curve[row].0)
    });
    let target = DVector::from_iterator(
        curve.len(),
        curve.iter().map(|&(f, value)| emphasis(f) * value),
    );
    let mut weights = DVector::<f64>::zeros(basis.len());
    let mut active: Vec<usize> = Vec::new();
    // Every round adds one term; more rounds than terms happen only when rounding makes it go in circles.
    for _ in 0..3 * basis.len() {
        let slope = matrix.tr_mul(&(&target - &matrix * &weights));
        let free = (0..basis.len()).filter(|column| !active.contains(column));
        let Some(best) = free.max_by(|&a, &b| slope[a].total_cmp(&slope[b])) else {
            break;
        };
        if slope[best] < 1e-9 {
            break;
        }
        active.push(best);
        loop {
            let columns = matrix.select_columns(&active);
            let Ok(solution) = columns.svd(true, true).solve(&target, 1e-10) else {
                return weights.as_slice().to_vec();
            };
            // How far towards the solution all weights stay positive.
            let step = active
                .iter()
                .zip(&solution)
                .fold(1.0, |step: f64, (&i, &to)| {
                    if to > 0.0 {
                        step
                    } else {
                        step.min(weights[i] / (weights[i] - to))
                    }
                });
            for (&i, &to) in active.iter().zip(&solution) {
                weights[i] += step * (to - weights[i]);
            }
            if step >= 1.0 {
                break;
            }
            active.retain(|&i| weights[i] > 1e-12);
            for i in 0..basis.len() {
                if !active.contains(&i) {
                    weights[i] = 0.0;
                }
            }
            if active.is_empty() {
                break;
            }
        }
    }
    weights.as_slice().to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::philox::Philox;

    const CSI: Blur = Blur::Lorentzian { h_mm2: 0.45 };

    /// A wave of every frequency up to Nyquist along the rows, and one aslant, keeps the share that the MTF says.
    #[test]
    fn waves_keep_what_the_mtf_says() {
        let pixel_mm = 0.15;
        let blur = GaussianSum::of(&CSI, pixel_mm).unwrap();
        let side = 128;
        for (periods_x, periods_y) in [(2, 0), (9, 0), (24, 0), (0, 40), (63, 0), (20, 20)] {
            let phase = |pixel: usize| {
                let (x, y) = ((pixel % side) as f64, (pixel / side) as f64);
                // Half periods with crests at the edges go on smoothly in the mirror.
                let along = |periods: usize, at: f64| {
                    (PI * periods as f64 * (at + 0.5) / side as f64).cos()
                };
                along(2 * periods_x, x) * along(2 * periods_y, y)
            };
            let wave: Vec<f32> = (0..side * side).map(|p| phase(p) as f32).collect();
            let blurred = blur.apply(&wave, side);
            let dot = |a: &[f32], b: &[f32]| -> f64 {
                a.iter()
                    .zip(b)
                    .map(|(a, b)| f64::from(*a) * f64::from(*b))
                    .sum()
            };
            let kept = dot(&blurred, &wave) / dot(&wave, &wave);
            let per_mm = |periods: usize| periods as f64 / (side as f64 * pixel_mm);
            let f = per_mm(periods_x).hypot(per_mm(periods_y));
            let expected = 1.0 / (1.0 + 0.45 * f * f);
            assert!(
                (kept - expected).abs() < 0.012,
                "{f}/mm: {kept}, {expected}"
            );
        }
    }

    /// White noise: its variance falls by Σh², to 4 sigma of 65 536 pixels (blurred ones are fewer: 2 %), and sums are kept.
    #[test]
    fn noise_falls_by_the_gain_and_the_sum_is_kept() {
        let blur = GaussianSum::of(&CSI, 0.2).unwrap();
        let mut rng = Philox::new(1, 0, 0);
        let noise: Vec<f32> = (0..65_536).map(|_| (rng.unit() - 0.5) as f32).collect();
        let blurred = blur.apply(&noise, 256);
        let sum = |plane: &[f32]| plane.iter().map(|&v| f64::from(v)).sum::<f64>();
        assert!((sum(&noise) - sum(&blurred)).abs() < 0.1);
        let variance: f64 = blurred.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>() / 65_536.0;
        let ratio = variance * 12.0 / blur.noise_gain();
        assert!((ratio - 1.0).abs() < 0.08, "{ratio}");
        assert!(blur.noise_gain() > 0.2 && blur.noise_gain() < 0.9);
    }

    #[test]
    fn curves_that_make_no_sense_are_refused() {
        let refused = |per_mm: &[f64], mtf: &[f64]| {
            let blur = Blur::Mtf {
                per_mm: per_mm.to_vec(),
                mtf: mtf.to_vec(),
            };
            GaussianSum::of(&blur, 0.2).unwrap_err().to_string()
        };
        assert!(refused(&[], &[]).contains("0 frequencies"));
        assert!(refused(&[1.0, 2.0], &[0.5]).contains("2 frequencies"));
        assert!(refused(&[2.0, 1.0], &[0.5, 0.4]).contains("frequency"));
        assert!(refused(&[1.0], &[f64::NAN]).contains("NaN"));
        assert!(refused(&[1.0, 2.0, 3.0], &[0.2, 0.9, 0.2]).contains("falls steadily"));
        let measured = Blur::Mtf {
            per_mm: vec![0.0, 0.5, 1.0, 2.0, 3.0],
            mtf: vec![1.0, 0.85, 0.65, 0.35, 0.2],
        };
        assert!(GaussianSum::of(&measured, 0.15).is_ok());
    }
}
