//! Scanner model: blur and noise.

use ppa_ct::with_room;
use ppa_ct::{Volume, VolumeError};
use rayon::prelude::*;

use super::draw::{Purpose, normal};
use super::voxelise::PhantomError;

/// A scanner with a Gaussian point spread and white noise that stores integer Hounsfield units of 12 bits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scanner {
    /// Full width at half maximum of the point spread along every axis, mm; 0 for none. It is applied to the voxel values,
    /// which are already means over a voxel's width.
    pub blur_fwhm_mm: f64,
    /// Standard deviation of the noise of a voxel, HU.
    pub noise_hu: f64,
    /// Seed of the noise.
    pub seed: u64,
}

/// Range of 12-bit values.
const RANGE_HU: [f64; 2] = [-1024.0, 3071.0];

impl Scanner {
    /// Returns the volume as this scanner would store it; the result does not depend on the number of threads.
    ///
    /// Voxels beyond the field of view have the values at its faces.
    ///
    /// # Errors
    /// [`PhantomError::Scanner`] unless blur and noise are between 0 and 20 mm, 0 and 1000 HU.
    pub fn scan(&self, phantom: &Volume) -> Result<Volume, PhantomError> {
        for (what, found, most) in [
            ("a blur in mm", self.blur_fwhm_mm, 20.0),
            ("a noise in HU", self.noise_hu, 1000.0),
        ] {
            if !(0.0..=most).contains(&found) {
                return Err(PhantomError::Scanner { what, found, most });
            }
        }
        let grid = phantom.grid();
        let mut hu = with_room(grid.len())?;
        hu.extend_from_slice(&phantom.hu());
        let sigma_mm = self.blur_fwhm_mm / (8.0 * 2.0_f64.ln()).sqrt();
        let mut stride = 1;
        for (count, spacing_mm) in grid.size().into_iter().zip(&grid.spacing_mm()) {
            hu = blurred(&hu, count, stride, &kernel(sigma_mm / spacing_mm))?;
            stride *= count;
        }
        hu.par_iter_mut().enumerate().for_each(|(index, hu)| {
            let noise = self.noise_hu * normal(self.seed, Purpose::ScannerNoise, index as u64);
            let value = (f64::from(*hu) + noise).round();
            *hu = value.clamp(RANGE_HU[0], RANGE_HU[1]) as f32;
        });
        Ok(Volume::new(grid.clone(), hu)?)
    }
}

/// Weights of a Gaussian in voxels, from the centre outwards, with sum 1 and variance `sigma` squared.
///
/// A Gaussian of less than about half a voxel, sampled at the lattice points, has too small a variance, down to zero:
/// a wider one is therefore sampled so that its variance on the lattice is correct.
fn kernel(sigma: f64) -> Vec<f64> {
    let (mut narrow, mut wide) = (0.0, sigma + 0.5);
    for _ in 0..60 {
        let middle = 0.5 * (narrow + wide);
        if variance(&sampled(middle)) < sigma * sigma {
            narrow = middle;
        } else {
            wide = middle;
        }
    }
    sampled(narrow)
}

/// The weights of a Gaussian at the points of a lattice, out to 5 standard deviations.
fn sampled(sigma: f64) -> Vec<f64> {
    let beside = 1..=(5.0 * sigma).ceil() as usize;
    let beside = beside.map(|n| (-0.5 * (n as f64 / sigma).powi(2)).exp());
    let half: Vec<f64> = std::iter::once(1.0).chain(beside).collect();
    let sum = half[0] + 2.0 * half[1..].iter().sum::<f64>();
    half.iter().map(|weight| weight / sum).collect()
}

fn variance(half: &[f64]) -> f64 {
    let squares = half.iter().enumerate().map(|(n, w)| w * (n * n) as f64);
    2.0 * squares.sum::<f64>()
}

/// Convolves values along the axis with this many voxels and this stride in memory.
fn blurred(
    hu: &[f32],
    count: usize,
    stride: usize,
    kernel: &[f64],
) -> Result<Vec<f32>, VolumeError> {
    let mut blurred = with_room(hu.len())?;
    (0..hu.len())
        .into_par_iter()
        .with_min_len(1 << 14)
        .map(|index| {
            let place = index / stride % count;
            let first = index - place * stride;
            let value = |n: usize| f64::from(hu[first + n * stride]);
            let mut sum = kernel[0] * value(place);
            for (reach, weight) in kernel.iter().enumerate().skip(1) {
                let before = place.saturating_sub(reach);
                let after = (place + reach).min(count - 1);
                sum += weight * (value(before) + value(after));
            }
            sum as f32
        })
        .collect_into_vec(&mut blurred);
    Ok(blurred)
}
