//! Convolution of an image with a kernel given by its transfer function.

use std::f64::consts::PI;

use nalgebra::{DMatrix, SymmetricEigen};
use rayon::prelude::*;

/// A symmetric kernel of the plane, as a sum of products of a kernel along rows and the same along columns.
#[derive(Debug, Clone)]
pub(crate) struct Kernel {
    /// Quarter of the kernel with non-negative offsets.
    quarter: DMatrix<f64>,
    /// Weights and halves of line kernels.
    terms: Vec<(f32, Vec<f32>)>,
}

/// Values below this share of the largest are omitted, in the kernel and in its terms.
const NEGLIGIBLE: f64 = 1e-6;

impl Kernel {
    /// The kernel whose transfer function is that of `transfer` up to the Nyquist frequency and 1 at frequency 0.
    ///
    /// `transfer` takes frequencies in cycles per pixel and gives the values at all pairs of them, the same for both
    /// axes; `reach` is in pixels. Samples of a narrow function would not do: their transfer is aliased near Nyquist.
    pub fn of_transfer(reach: usize, transfer: impl FnOnce(&[f64]) -> DMatrix<f64>) -> Self {
        let frequencies = frequencies(2 * reach.max(32));
        let count = frequencies.len();
        let waves = DMatrix::from_fn(reach + 1, count, |n, i| {
            (2.0 * PI * frequencies[i] * n as f64).cos() / count as f64
        });
        Self::of_quarter(&waves * transfer(&frequencies) * waves.transpose()).scaled_to(1.0)
    }

    /// The kernel of the squared values, scaled to the given sum; it spreads variances.
    pub fn squared(&self, sum: f64) -> Self {
        Self::of_quarter(self.quarter.map(|value| value * value)).scaled_to(sum)
    }

    fn of_quarter(quarter: DMatrix<f64>) -> Self {
        let least = NEGLIGIBLE * quarter.amax();
        let needed = (0..quarter.nrows())
            .rev()
            .find(|&n| quarter.row(n).amax() > least);
        let size = needed.unwrap_or(0) + 1;
        let quarter = quarter.view((0, 0), (size, size)).into_owned();
        let eigen = SymmetricEigen::new(quarter.clone());
        let least = NEGLIGIBLE * eigen.eigenvalues.amax();
        let terms = eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter());
        let terms = terms
            .filter(|(weight, _)| weight.abs() > least)
            .map(|(&weight, line)| (weight as f32, line.iter().map(|&v| v as f32).collect()))
            .collect();
        Self { quarter, terms }
    }

    fn scaled_to(mut self, sum: f64) -> Self {
        let factor = sum / self.sum_of(|value| value);
        self.quarter *= factor;
        for (weight, _) in &mut self.terms {
            *weight *= factor as f32;
        }
        self
    }

    /// Σ h²: the factor by which the kernel reduces the variance of white noise.
    pub fn noise_gain(&self) -> f64 {
        self.sum_of(|value| value * value)
    }

    /// Sum over the plane of a function of the values.
    fn sum_of(&self, of: impl Fn(f64) -> f64) -> f64 {
        let twice = |n: usize| if n == 0 { 1.0 } else { 2.0 };
        let size = self.quarter.nrows();
        (0..size * size)
            .map(|i| (i / size, i % size))
            .map(|(n, m)| twice(n) * twice(m) * of(self.quarter[(n, m)]))
            .sum()
    }

    /// Convolves a row-major plane, continued beyond its edges as its mirror image so that the sum is kept.
    pub fn apply(&self, plane: &[f32], columns: usize) -> Vec<f32> {
        let rows = plane.len() / columns;
        let mut sum = vec![0.0_f32; plane.len()];
        let mut across = vec![0.0_f32; plane.len()];
        for (weight, line) in &self.terms {
            across
                .par_chunks_mut(columns)
                .zip(plane.par_chunks(columns))
                .for_each(|(to, from)| {
                    for (column, to) in to.iter_mut().enumerate() {
                        *to = at_mirrored(from.len(), column, line, |i| from[i]);
                    }
                });
            sum.par_chunks_mut(columns)
                .enumerate()
                .for_each(|(row, to)| {
                    let mut add = |factor: f32, from: usize| {
                        let from = &across[from * columns..][..columns];
                        for (to, from) in to.iter_mut().zip(from) {
                            *to += factor * from;
                        }
                    };
                    add(weight * line[0], row);
                    for (n, &k) in line.iter().enumerate().skip(1) {
                        add(weight * k, mirrored(row as isize - n as isize, rows));
                        add(weight * k, mirrored(row as isize + n as isize, rows));
                    }
                });
        }
        sum
    }
}

/// Midpoints of `count` equal intervals from 0 to the Nyquist frequency, cycles per pixel.
pub(crate) fn frequencies(count: usize) -> Vec<f64> {
    (0..count)
        .map(|i| 0.5 * (i as f64 + 0.5) / count as f64)
        .collect()
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

/// Index inside 0..len after repeated reflection at both ends.
fn mirrored(index: isize, len: usize) -> usize {
    let period = 2 * len as isize;
    let folded = index.rem_euclid(period);
    folded.min(period - 1 - folded) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    fn plane(values: impl Fn(usize, usize) -> f64, columns: usize, rows: usize) -> Vec<f32> {
        let pixels = (0..columns * rows).map(|pixel| (pixel % columns, pixel / columns));
        pixels.map(|(x, y)| values(x, y) as f32).collect()
    }

    /// A transfer function that is not a product of one along x and one along y.
    fn transfer(fx: f64, fy: f64) -> f64 {
        1.0 / (1.0 + 20.0 * (fx * fx + fy * fy))
    }

    fn kernel() -> Kernel {
        Kernel::of_transfer(16, |f| {
            DMatrix::from_fn(f.len(), f.len(), |i, j| transfer(f[i], f[j]))
        })
    }

    /// A wave along rows, along columns or aslant, up to the edge of the plane of frequencies, keeps what the transfer function
    /// says; whole waves in the mirror continue as waves. 0.01 for the kink at Nyquist, beyond 16 pixels.
    #[test]
    fn waves_keep_what_the_transfer_function_says() {
        let (columns, rows) = (64, 48);
        for (i, j) in [(0, 0), (5, 0), (0, 30), (63, 0), (20, 20), (63, 47)] {
            let along = |n: usize, at: usize, size: usize| {
                (PI * n as f64 * (at as f64 + 0.5) / size as f64).cos()
            };
            let wave = |x: usize, y: usize| along(i, x, columns) * along(j, y, rows);
            let expected = transfer(
                0.5 * i as f64 / columns as f64,
                0.5 * j as f64 / rows as f64,
            );
            let found = kernel().apply(&plane(wave, columns, rows), columns);
            for (pixel, found) in found.iter().enumerate() {
                let wave = wave(pixel % columns, pixel / columns);
                let error = f64::from(*found) - expected * wave;
                assert!(error.abs() < 0.01, "wave {i}, {j} at {pixel}: {error}");
            }
        }
    }

    /// A point spreads into the kernel, and in the kernel of squares into its squares; both keep sums, edges included.
    #[test]
    fn points_spread_by_the_kernel_and_sums_are_kept() {
        let (columns, rows) = (50, 41);
        let point = plane(
            |x, y| f64::from(u8::from((x, y) == (25, 20))),
            columns,
            rows,
        );
        let kernel = kernel();
        let spread = kernel.apply(&point, columns);
        let squares = kernel.squared(kernel.noise_gain()).apply(&point, columns);
        for (value, square) in spread.iter().zip(&squares) {
            assert!((value * value - square).abs() < 2e-5, "{value} {square}");
        }
        let ramp = plane(|x, y| (x * x + 3 * y) as f64, columns, rows);
        let sum = |plane: &[f32]| plane.iter().map(|&v| f64::from(v)).sum::<f64>();
        let kept = sum(&kernel.apply(&ramp, columns)) / sum(&ramp);
        assert!((kept - 1.0).abs() < 3e-6, "{kept}");
        let gain: f64 = spread.iter().map(|&v| f64::from(v).powi(2)).sum();
        assert!((gain / kernel.noise_gain() - 1.0).abs() < 1e-4);
    }

    /// A plane narrower than the kernel: the mirror image is repeated several times.
    #[test]
    fn an_even_plane_stays_even_however_narrow() {
        for (columns, rows) in [(1, 1), (2, 5), (7, 3)] {
            let even = vec![3.0_f32; columns * rows];
            let spread = kernel().apply(&even, columns);
            assert!(spread.iter().all(|v| (v - 3.0).abs() < 2e-5), "{spread:?}");
        }
    }

    #[test]
    fn a_transfer_function_of_1_leaves_a_point() {
        let kernel = Kernel::of_transfer(12, |f| {
            let ones = DVector::from_element(f.len(), 1.0);
            &ones * ones.transpose()
        });
        assert_eq!(kernel.quarter.nrows(), 1);
        assert!((kernel.noise_gain() - 1.0).abs() < 1e-12);
    }
}
