//! A volume on another lattice.

use nalgebra::{Matrix4, Vector3};
use rayon::prelude::*;

use crate::grid::Grid;
use crate::low_pass::{low_pass, sigma_voxels};
use crate::values::{Values, zeros};
use crate::volume::Volume;
use crate::volume_error::VolumeError;

/// Interpolation of values between voxel centres.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interpolation {
    /// The value of the nearest centre, for labels. Never blurred, whatever the spacing.
    Nearest,
    /// Trilinear: exact for linear fields, never outside the range of the values.
    Linear,
    /// Keys' cubic convolution with a = −1/2 (doi:10.1109/TASSP.1981.1163711): exact for quadratic fields except in the outermost cells, and may
    /// overshoot at edges.
    Cubic,
}

/// Largest distance outside the outer faces that still counts as inside, in voxels: rounding.
const SLACK: f64 = 1e-6;
/// Distance in voxels below which a position has exactly the value of the centre, so that coinciding lattices give equal values.
const ON_A_CENTRE: f64 = 1e-8;

impl Volume {
    /// Returns the same box with other spacings in mm along i, j, k.
    ///
    /// Axes that get coarser are low-passed first, except with [`Interpolation::Nearest`].
    ///
    /// # Errors
    /// The same as [`Grid::with_spacing`].
    pub fn resampled(
        &self,
        spacing_mm: Vector3<f64>,
        how: Interpolation,
    ) -> Result<Self, VolumeError> {
        let grid = self.grid().with_spacing(spacing_mm)?;
        // Every centre is inside: `outside_hu` is never used.
        self.resampled_to(&grid, how, 0.0)
    }

    /// Returns the values at the centres of another lattice, which may be rotated and sheared;
    /// `outside_hu` beyond the faces of this volume.
    ///
    /// Axes along which the other lattice is coarser are low-passed first, except with
    /// [`Interpolation::Nearest`]. The result does not depend on the number of threads.
    ///
    /// # Errors
    /// [`VolumeError::NotFinite`] when `outside_hu` is needed and not finite, [`VolumeError::Memory`]
    /// when the voxels of the lattice do not fit in memory.
    pub fn resampled_to(
        &self,
        grid: &Grid,
        how: Interpolation,
        outside_hu: f32,
    ) -> Result<Self, VolumeError> {
        let here_from_there = here_from_there(self.grid(), grid);
        let sigma = [0, 1, 2].map(|axis| {
            let step = here_from_there.fixed_view::<1, 3>(axis, 0).norm();
            sigma_voxels(step)
        });
        if how == Interpolation::Nearest || sigma == [0.0; 3] {
            return interpolated(self.values(), self.grid(), grid, how, outside_hu);
        }
        let blurred = low_pass(self.values(), self.grid().size(), sigma)?;
        interpolated(Values::F32(&blurred), self.grid(), grid, how, outside_hu)
    }

    /// Returns the volume on [`Grid::upright`], a lattice with right angles; `outside_hu` in the corners
    /// that the sheared one leaves empty. A volume that is not sheared is returned unchanged.
    ///
    /// Slices are only shifted within their planes, not made coarser: no low-pass is applied.
    ///
    /// # Errors
    /// The same as [`Grid::upright`]; [`VolumeError::NotFinite`] when `outside_hu` is needed and not finite.
    pub fn upright(&self, how: Interpolation, outside_hu: f32) -> Result<Self, VolumeError> {
        /// Leans below this are rounding in the header: a millimetre in 10 m.
        const RIGHT_ANGLE: f64 = 1e-4;
        let axes = self.grid().direction();
        let lean = (axes.tr_mul(&axes) - nalgebra::Matrix3::identity()).amax();
        if lean < RIGHT_ANGLE {
            return Ok(self.clone());
        }
        let upright = self.grid().upright()?;
        interpolated(self.values(), self.grid(), &upright, how, outside_hu)
    }
}

/// Transform to voxel indices of `here` from those of `there`.
fn here_from_there(here: &Grid, there: &Grid) -> Matrix4<f64> {
    here.voxel_from_ct().matrix() * there.ct_from_voxel().matrix()
}

/// Interpolates values of a lattice at the centres of another one.
fn interpolated(
    hu: Values,
    here: &Grid,
    there: &Grid,
    how: Interpolation,
    outside_hu: f32,
) -> Result<Volume, VolumeError> {
    let source = Source {
        hu,
        size: here.size(),
        outside_hu,
    };
    let mut hu = zeros(there.len())?;
    source.fill(&mut hu, there.size(), &here_from_there(here, there), how);
    Volume::new(there.clone(), hu)
}

/// The values to interpolate.
struct Source<'a> {
    hu: Values<'a>,
    size: [usize; 3],
    outside_hu: f32,
}

/// Weights of up to `N` neighbours along one axis.
type Taps<const N: usize> = [(usize, f64); N];

impl Source<'_> {
    fn fill(
        &self,
        hu: &mut [f32],
        [nx, ny, _]: [usize; 3],
        here_from_there: &Matrix4<f64>,
        how: Interpolation,
    ) {
        let column = |axis| here_from_there.fixed_view::<3, 1>(0, axis).into_owned();
        let [di, dj, dk, origin] = [0, 1, 2, 3].map(column);
        hu.par_chunks_mut(nx).enumerate().for_each(|(row, values)| {
            let start = origin + dj * (row % ny) as f64 + dk * (row / ny) as f64;
            for (i, value) in values.iter_mut().enumerate() {
                *value = self.at(start + di * i as f64, how);
            }
        });
    }

    fn at(&self, place: Vector3<f64>, how: Interpolation) -> f32 {
        let mut inside = [0.0; 3];
        for axis in 0..3 {
            let last = (self.size[axis] - 1) as f64;
            if !(-0.5 - SLACK..=last + 0.5 + SLACK).contains(&place[axis]) {
                return self.outside_hu;
            }
            let whole = place[axis].round();
            let on_a_centre = (place[axis] - whole).abs() < ON_A_CENTRE;
            inside[axis] = if on_a_centre { whole } else { place[axis] }.clamp(0.0, last);
        }
        let axes = [0, 1, 2];
        match how {
            Interpolation::Nearest => {
                let [i, j, k] = inside.map(|p| p.round() as usize);
                self.hu.at(i + self.size[0] * (j + self.size[1] * k))
            }
            Interpolation::Linear => self.sum(axes.map(|a| linear_taps(inside[a], self.size[a]))),
            Interpolation::Cubic => self.sum(axes.map(|a| cubic_taps(inside[a], self.size[a]))),
        }
    }

    fn sum<const N: usize>(&self, [along_i, along_j, along_k]: [Taps<N>; 3]) -> f32 {
        let mut sum = 0.0;
        for (k, wk) in along_k {
            for (j, wj) in along_j {
                let start = self.size[0] * (j + self.size[1] * k);
                let row = self.hu.part(start..start + self.size[0]);
                let line = along_i.iter().map(|&(i, wi)| wi * f64::from(row.at(i)));
                sum += wk * wj * line.sum::<f64>();
            }
        }
        sum as f32
    }
}

fn linear_taps(place: f64, count: usize) -> Taps<2> {
    let base = (place as usize).min(count.saturating_sub(2));
    let t = place - base as f64;
    [(base, 1.0 - t), ((base + 1).min(count - 1), t)]
}

/// Weights of the four nearest centres; beyond the ends values are extrapolated linearly.
fn cubic_taps(place: f64, count: usize) -> Taps<4> {
    let base = (place as usize).min(count.saturating_sub(2));
    let t = place - base as f64;
    let mut w = [
        t * (-0.5 + t * (1.0 - 0.5 * t)),
        1.0 + t * t * (-2.5 + 1.5 * t),
        t * (0.5 + t * (2.0 - 1.5 * t)),
        t * t * (-0.5 + 0.5 * t),
    ];
    if base == 0 {
        w[1] += 2.0 * w[0];
        w[2] -= w[0];
        w[0] = 0.0;
    }
    if base + 2 >= count {
        w[2] += 2.0 * w[3];
        w[1] -= w[3];
        w[3] = 0.0;
    }
    let last = count - 1;
    [
        (base.saturating_sub(1), w[0]),
        (base, w[1]),
        ((base + 1).min(last), w[2]),
        ((base + 2).min(last), w[3]),
    ]
}
