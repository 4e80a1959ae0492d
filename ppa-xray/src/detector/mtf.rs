//! Modulation transfer function of a converter as a sum of Gaussians.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use crate::beam::receptor::{Blur, ReceptorError, require};

/// An MTF as a sum of Gaussians of the frequency, without the aperture of the pixels.
///
/// Any MTF that falls like those of converters can be written so: 1/(1 + H f²) is ∫ exp(−t) exp(−t H f²) dt. Weights are positive and
/// sum to 1, so that the signal is kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Mtf {
    /// Weight and standard deviation of the spread in pixels.
    terms: Vec<(f64, f64)>,
}

/// Number of aliases on either side; without blur the rest has 6e-3 of the power at Nyquist.
const ALIASES: i32 = 16;

/// Largest accepted difference between a curve and its sum of Gaussians.
const WORST_FIT: f64 = 0.03;

/// A value of a transfer function at a frequency.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CurvePoint {
    pub per_mm: f64,
    pub value: f64,
    /// Weight of its error in a fit, at most 1.
    pub weight: f64,
}

impl CurvePoint {
    fn new(per_mm: f64, value: f64) -> Self {
        Self {
            per_mm,
            value,
            weight: 1.0,
        }
    }
}

/// Three times the Nyquist frequency, the end of the first aliases.
pub(crate) fn last_per_mm(pixel_mm: f64) -> f64 {
    1.5 / pixel_mm
}

/// Points of 1 / (1 + H f²).
pub(crate) fn lorentzian(h_mm2: f64, last_per_mm: f64) -> Vec<CurvePoint> {
    let points = (0..=64).map(|i| last_per_mm * f64::from(i) / 64.0);
    points
        .map(|f| CurvePoint::new(f, 1.0 / (1.0 + h_mm2 * f * f)))
        .collect()
}

impl Mtf {
    /// The MTF of the signal, fitted up to three times the Nyquist frequency, the end of the first aliases.
    ///
    /// # Errors
    /// [`ReceptorError`] for invalid numbers, and for a curve that no sum of Gaussians fits within 0.03.
    pub fn of(blur: &Blur, pixel_mm: f64) -> Result<Self, ReceptorError> {
        let last_per_mm = last_per_mm(pixel_mm);
        let curve = match blur {
            Blur::Lorentzian { h_mm2, .. } => {
                let expected = "1e-6 to 1000 mm²";
                require("H of the MTF 1/(1 + H f²)", *h_mm2, 1e-6..=1e3, expected)?;
                lorentzian(*h_mm2, last_per_mm)
            }
            Blur::Mtf { per_mm, mtf, .. } => table("MTF", per_mm, mtf, last_per_mm)?,
        };
        Self::fitted("MTF", &curve, pixel_mm)
    }

    /// Fits a sum of Gaussians to the points of a curve.
    ///
    /// # Errors
    /// [`ReceptorError::Mtf`] if the error of a point exceeds 0.03 divided by its weight.
    pub fn fitted(
        name: &'static str,
        curve: &[CurvePoint],
        pixel_mm: f64,
    ) -> Result<Self, ReceptorError> {
        let sigma_mm = |i: i32| pixel_mm * 0.05 * 1.35_f64.powi(i);
        let basis: Vec<f64> = std::iter::once(0.0).chain((0..24).map(sigma_mm)).collect();
        let weights = fit(curve, &basis);
        let sum: f64 = weights.iter().sum();
        for point in curve {
            let parts = weights.iter().zip(&basis);
            let found = parts.map(|(w, sigma)| w / sum * gaussian_mtf(*sigma, point.per_mm));
            let found: f64 = found.sum();
            if point.weight * (found - point.value).abs() > WORST_FIT {
                return Err(ReceptorError::Mtf {
                    curve: name,
                    per_mm: point.per_mm,
                    found: point.value,
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

    /// Weights and standard deviations of the Gaussians in pixels.
    pub fn terms(&self) -> &[(f64, f64)] {
        &self.terms
    }

    /// The value at a frequency in cycles per pixel.
    pub fn at(&self, frequency: f64) -> f64 {
        let terms = self.terms.iter();
        terms
            .map(|&(w, sigma)| w * gaussian_mtf(sigma, frequency))
            .sum()
    }

    /// Values at all pairs of `frequencies`, in cycles per pixel.
    pub fn plane(&self, frequencies: &[f64]) -> DMatrix<f64> {
        let terms = self.terms.iter();
        let along = |sigma: f64| frequencies.iter().map(move |&f| gaussian_mtf(sigma, f));
        sum_of_squares(
            frequencies.len(),
            terms.map(|&(w, sigma)| (w, along(sigma))),
        )
    }

    /// Power of the noise of pixels: Σ T² sinc² sinc² over the aliases, at all pairs of `frequencies`.
    pub fn noise_power(&self, frequencies: &[f64]) -> DMatrix<f64> {
        let pairs = self
            .terms
            .iter()
            .flat_map(|a| self.terms.iter().map(move |b| (a, b)));
        // The product of two Gaussians is one.
        let aliased = |sigma: f64| {
            frequencies.iter().map(move |&f| {
                let aliases = (-ALIASES..=ALIASES).map(|k| f + f64::from(k));
                aliases
                    .map(|f| gaussian_mtf(sigma, f) * sinc(f).powi(2))
                    .sum()
            })
        };
        let terms = pairs.map(|(a, b)| (a.0 * b.0, aliased(a.1.hypot(b.1))));
        sum_of_squares(frequencies.len(), terms)
    }

    /// Distance in pixels beyond which less than 1e-4 of the signal is spread.
    pub fn reach(&self) -> usize {
        let beyond = |reach: usize| -> f64 {
            let terms = self.terms.iter().filter(|(_, sigma)| *sigma > 0.0);
            terms
                .map(|(weight, sigma)| weight * (-0.5 * (reach as f64 / sigma).powi(2)).exp())
                .sum()
        };
        (0..).find(|&reach| beyond(reach) < 1e-4).unwrap_or(0)
    }
}

/// Σ w v vᵀ.
fn sum_of_squares<V: Iterator<Item = f64>>(
    size: usize,
    terms: impl Iterator<Item = (f64, V)>,
) -> DMatrix<f64> {
    let mut sum = DMatrix::zeros(size, size);
    for (weight, line) in terms {
        let line = DVector::from_iterator(size, line);
        sum.ger(weight, &line, &line, 1.0);
    }
    sum
}

/// sin(πf) / πf, the transfer function of a square of side 1.
pub(crate) fn sinc(f: f64) -> f64 {
    if f == 0.0 {
        1.0
    } else {
        (PI * f).sin() / (PI * f)
    }
}

/// exp(−2π²σ²f²).
fn gaussian_mtf(sigma: f64, f: f64) -> f64 {
    (-2.0 * (PI * sigma * f).powi(2)).exp()
}

/// Checks a measured curve, puts (0, 1) in front, and removes the points beyond the last frequency.
pub(crate) fn table(
    name: &'static str,
    per_mm: &[f64],
    values: &[f64],
    last_per_mm: f64,
) -> Result<Vec<CurvePoint>, ReceptorError> {
    if per_mm.len() != values.len() || per_mm.is_empty() {
        return Err(ReceptorError::MtfTable {
            curve: name,
            frequencies: per_mm.len(),
            values: values.len(),
        });
    }
    let mut curve = vec![CurvePoint::new(0.0, 1.0)];
    for (&f, &value) in per_mm.iter().zip(values) {
        let last = curve[curve.len() - 1].per_mm;
        if f == 0.0 && curve.len() == 1 {
            require("MTF or noise transfer at 0/mm", value, 1.0..=1.0, "1")?;
            continue;
        }
        let above = "a number above the previous frequency";
        require(
            "a frequency of the MTF or noise transfer table in 1/mm",
            f,
            last.next_up()..=f64::MAX,
            above,
        )?;
        let what = "a value of the MTF or noise transfer table";
        require(what, value, 0.0..=1.0, "0 to 1")?;
        curve.push(CurvePoint::new(f, value));
    }
    // One point beyond it is kept to guide the fit.
    let inside = curve.partition_point(|point| point.per_mm <= last_per_mm);
    curve.truncate(inside + 1);
    Ok(curve)
}

/// Non-negative least squares by an active set (Lawson and Hanson, Solving Least Squares Problems, 1974, chapter 23).
///
/// The value at frequency 0 has a large weight, so that the weights sum to about 1.
fn fit(curve: &[CurvePoint], basis: &[f64]) -> Vec<f64> {
    const EMPHASIS: f64 = 30.0;
    let emphasis = |point: &CurvePoint| {
        if point.per_mm == 0.0 {
            EMPHASIS
        } else {
            point.weight
        }
    };
    let matrix = DMatrix::from_fn(curve.len(), basis.len(), |row, column| {
        emphasis(&curve[row]) * gaussian_mtf(basis[column], curve[row].per_mm)
    });
    let target = DVector::from_iterator(
        curve.len(),
        curve.iter().map(|point| emphasis(point) * point.value),
    );
    let mut weights = DVector::<f64>::zeros(basis.len());
    let mut active: Vec<usize> = Vec::new();
    // Every round adds one term; there are more rounds than terms only if rounding causes a cycle.
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
            // Largest step towards the solution for which all weights stay positive.
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

    /// T and the sum over its aliases, against the curve itself: the fit is accurate to 0.012 where the image is not black.
    #[test]
    fn planes_are_those_of_the_curve() {
        for (h_mm2, pixel_mm) in [(0.45, 0.15), (0.45, 0.5), (0.45, 1.0), (0.02, 0.15)] {
            let mtf = Mtf::of(&Blur::lorentzian(h_mm2), pixel_mm).unwrap();
            let curve =
                |fx: f64, fy: f64| 1.0 / (1.0 + h_mm2 * (fx * fx + fy * fy) / pixel_mm.powi(2));
            let frequencies = [0.0, 0.1, 0.25, 0.4, 0.5];
            let (plane, power) = (mtf.plane(&frequencies), mtf.noise_power(&frequencies));
            let aliases = || (-30..=30).map(f64::from);
            for (i, &fx) in frequencies.iter().enumerate() {
                for (j, &fy) in frequencies.iter().enumerate() {
                    let error = plane[(i, j)] - curve(fx, fy);
                    assert!(error.abs() < 0.012, "T({fx}, {fy}) off by {error}");
                    let expected: f64 = aliases()
                        .flat_map(|x| aliases().map(move |y| (fx + x, fy + y)))
                        .map(|(x, y)| (curve(x, y) * sinc(x) * sinc(y)).powi(2))
                        .sum();
                    let error = power[(i, j)].sqrt() - expected.sqrt();
                    assert!(error.abs() < 0.012, "noise at {fx}, {fy} off by {error}");
                }
            }
        }
    }

    #[test]
    fn curves_that_make_no_sense_are_refused() {
        let refused = |per_mm: &[f64], mtf: &[f64]| {
            let blur = Blur::Mtf {
                per_mm: per_mm.to_vec(),
                mtf: mtf.to_vec(),
                noise: None,
            };
            Mtf::of(&blur, 0.2).unwrap_err().to_string()
        };
        assert!(refused(&[], &[]).contains("are 0 and 0"));
        assert!(refused(&[1.0, 2.0], &[0.5]).contains("are 2 and 1"));
        assert!(refused(&[2.0, 1.0], &[0.5, 0.4]).contains("frequency"));
        assert!(refused(&[1.0], &[f64::NAN]).contains("NaN"));
        assert!(refused(&[1.0, 2.0, 3.0], &[0.2, 0.9, 0.2]).contains("falls steadily"));
        let measured = Blur::Mtf {
            per_mm: vec![0.0, 0.5, 1.0, 2.0, 3.0],
            mtf: vec![1.0, 0.85, 0.65, 0.35, 0.2],
            noise: None,
        };
        assert!(Mtf::of(&measured, 0.15).is_ok());
    }
}
