//! A Gaussian low-pass along the axes of a volume, so that coarser samples do not alias.

use rayon::prelude::*;

use crate::values::{Values, with_room, zeros};
use crate::volume_error::VolumeError;

/// Truncation radius of a Gaussian, in standard deviations.
const REACH: f64 = 4.0;

/// Width of the Gaussian, in voxels, for samples `step` voxels apart; 0 if none is needed.
///
/// A variance of (step² − 1)/4 leaves 29 % of a wave at the new Nyquist frequency when the step
/// is large, 6 % at one and a half times and 0.7 % at twice that frequency; the 1 accounts for the
/// blur of the voxels themselves.
pub(crate) fn sigma_voxels(step: f64) -> f64 {
    // Rounding of an affine must not blur a volume that is not getting coarser.
    if step < 1.0 + 1e-6 {
        return 0.0;
    }
    0.5 * (step * step - 1.0).sqrt()
}

/// Blurs values (i fastest) by `sigma_voxels` along each axis; the volume is mirrored at its faces,
/// which keeps the sum.
pub(crate) fn low_pass(
    hu: Values,
    size: [usize; 3],
    sigma_voxels: [f64; 3],
) -> Result<Vec<f32>, VolumeError> {
    let mut values = with_room(hu.len())?;
    values.extend(hu.iter());
    for (axis, sigma) in sigma_voxels.into_iter().enumerate() {
        if sigma > 0.0 && size[axis] > 1 {
            // The mirrored volume repeats after twice its side: a Gaussian that wide leaves 5e-9 of its longest
            // wave, 2 exp(-2 π² (σ / period)²), and a wider one does not change the mean.
            let sigma = sigma.min(2.0 * size[axis] as f64);
            values = along(&values, size, axis, &kernel(sigma))?;
        }
    }
    Ok(values)
}

/// Weights of a Gaussian at −reach..=reach, with sum 1.
fn kernel(sigma: f64) -> Vec<f64> {
    let reach = (REACH * sigma).ceil() as i64;
    let weights = (-reach..=reach).map(|n| (-0.5 * (n as f64 / sigma).powi(2)).exp());
    let weights = weights.collect::<Vec<_>>();
    let sum = weights.iter().sum::<f64>();
    weights.into_iter().map(|w| w / sum).collect()
}

fn along(
    values: &[f32],
    [nx, ny, nz]: [usize; 3],
    axis: usize,
    kernel: &[f64],
) -> Result<Vec<f32>, VolumeError> {
    let count = [nx, ny, nz][axis];
    let reach = (kernel.len() / 2) as i64;
    // Source indices of the positions from −reach to count + reach in the mirrored volume.
    let sources = (-reach..count as i64 + reach).map(|at| mirrored(at, count));
    let sources = sources.collect::<Vec<_>>();
    let row = |j: usize, k: usize| &values[nx * (j + ny * k)..][..nx];
    let mut blurred = zeros(values.len())?;
    blurred
        .par_chunks_mut(nx)
        .enumerate()
        .for_each_init(Vec::new, |sums, (index, place)| {
            let (j, k) = (index % ny, index / ny);
            if axis == 0 {
                let source = row(j, k);
                sums.clear();
                sums.extend(sources.iter().map(|&i| f64::from(source[i])));
                for (place, near) in place.iter_mut().zip(sums.windows(kernel.len())) {
                    let terms = kernel.iter().zip(near).map(|(w, value)| w * value);
                    *place = terms.sum::<f64>() as f32;
                }
                return;
            }
            sums.clear();
            sums.resize(nx, 0.0);
            for (weight, &other) in kernel.iter().zip(&sources[[0, j, k][axis]..]) {
                let source = if axis == 1 {
                    row(other, k)
                } else {
                    row(j, other)
                };
                for (sum, &value) in sums.iter_mut().zip(source) {
                    *sum += weight * f64::from(value);
                }
            }
            for (place, &sum) in place.iter_mut().zip(sums.iter()) {
                *place = sum as f32;
            }
        });
    Ok(blurred)
}

/// Index of the voxel at a position outside when the volume is mirrored at its faces.
fn mirrored(at: i64, count: usize) -> usize {
    let count = count as i64;
    let folded = at.rem_euclid(2 * count);
    folded.min(2 * count - 1 - folded) as usize
}
