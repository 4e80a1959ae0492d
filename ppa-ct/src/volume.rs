//! A CT volume: Hounsfield units on a [`Grid`].

use std::borrow::Cow;
use std::sync::Arc;

use nalgebra::Point3;
use rayon::prelude::*;

use crate::grid::{Grid, GridError};
use crate::values::{Values, Voxels, with_room};
use crate::volume_error::VolumeError;

/// Hounsfield units on a lattice; i runs fastest in memory.
///
/// A clone shares the voxels.
#[derive(Debug, Clone)]
pub struct Volume {
    grid: Grid,
    voxels: Arc<Voxels>,
}

impl PartialEq for Volume {
    fn eq(&self, other: &Self) -> bool {
        self.grid == other.grid && self.values() == other.values()
    }
}

impl Volume {
    /// Makes a volume from one value per voxel, i fastest.
    ///
    /// # Errors
    /// [`VolumeError`] when the number of values is wrong or one is not finite.
    pub fn new(grid: Grid, hu: Vec<f32>) -> Result<Self, VolumeError> {
        Self::of_voxels(grid, Voxels::F32(hu))
    }

    /// Makes a volume of integers, which takes half the memory.
    ///
    /// # Errors
    /// [`VolumeError`] when the number of values is wrong.
    pub fn from_i16(grid: Grid, hu: Vec<i16>) -> Result<Self, VolumeError> {
        Self::of_voxels(grid, Voxels::I16(hu))
    }

    pub(crate) fn of_voxels(grid: Grid, voxels: Voxels) -> Result<Self, VolumeError> {
        let found = voxels.values().len();
        if found != grid.len() {
            return Err(VolumeError::Length {
                found,
                expected: grid.len(),
            });
        }
        if let Voxels::F32(hu) = &voxels
            && let Some(bad) = hu.par_iter().position_first(|v| !v.is_finite())
        {
            return Err(VolumeError::NotFinite(grid.voxel(bad)));
        }
        Ok(Self {
            grid,
            voxels: Arc::new(voxels),
        })
    }

    /// The lattice.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// All values, i fastest.
    ///
    /// A copy of twice the memory if the volume keeps integers: [`Volume::values`] avoids it.
    pub fn hu(&self) -> Cow<'_, [f32]> {
        self.values().to_f32()
    }

    /// All values, i fastest, in their storage type.
    pub fn values(&self) -> Values<'_> {
        self.voxels.values()
    }

    /// Checks that memory has room for `bytes` more per voxel, plus a margin for small allocations.
    ///
    /// The memory is allocated and released again: an allocation that failed later would abort the program.
    ///
    /// # Errors
    /// [`VolumeError::Memory`].
    pub fn expect_room(&self, bytes: usize) -> Result<(), VolumeError> {
        const SMALL_BYTES: usize = 1 << 24;
        let voxels = self.grid.len();
        let wanted = voxels.saturating_mul(bytes).saturating_add(SMALL_BYTES);
        match with_room::<u8>(wanted) {
            Ok(_) => Ok(()),
            Err(_) => Err(VolumeError::Memory { voxels }),
        }
    }

    /// The value of voxel (i, j, k).
    ///
    /// # Panics
    /// If the voxel is outside the grid.
    pub fn at(&self, voxel: [usize; 3]) -> f32 {
        self.values().at(self.grid.index(voxel))
    }

    /// Trilinear interpolation at a world point; `None` outside the box of voxel centres.
    pub fn sample(&self, point_ct: &Point3<f64>) -> Option<f64> {
        let p = self.grid.voxel_from_ct() * point_ct;
        let size = self.grid.size();
        let mut base = [0; 3];
        let mut frac = [0.0; 3];
        for axis in 0..3 {
            let last = (size[axis] - 1) as f64;
            if !(0.0..=last).contains(&p[axis]) {
                return None;
            }
            base[axis] = (p[axis] as usize).min(size[axis].saturating_sub(2));
            frac[axis] = p[axis] - base[axis] as f64;
        }
        let mut sum = 0.0;
        for corner in 0..8 {
            let mut weight = 1.0;
            let mut voxel = base;
            for axis in 0..3 {
                if corner >> axis & 1 == 1 {
                    weight *= frac[axis];
                    voxel[axis] = (voxel[axis] + 1).min(size[axis] - 1);
                } else {
                    weight *= 1.0 - frac[axis];
                }
            }
            sum += weight * f64::from(self.at(voxel));
        }
        Some(sum)
    }

    /// The voxels `low..high` (half-open on every axis), at the same world positions.
    ///
    /// # Errors
    /// [`VolumeError::Grid`] when the range is empty or exceeds the volume, [`VolumeError::Memory`].
    pub fn crop(&self, low: [usize; 3], high: [usize; 3]) -> Result<Self, VolumeError> {
        let grid = self.grid.crop(low, high)?;
        let voxels = match &*self.voxels {
            Voxels::I16(hu) => Voxels::I16(cut(hu, &self.grid, low, high)?),
            Voxels::F32(hu) => Voxels::F32(cut(hu, &self.grid, low, high)?),
        };
        Ok(Self {
            grid,
            voxels: Arc::new(voxels),
        })
    }

    /// The smallest block of voxels that contains every voxel whose centre is in the world box
    /// `min..=max` (LPS, mm).
    ///
    /// # Errors
    /// [`VolumeError::Reversed`] unless `min` ≤ `max` along every axis, [`VolumeError::Grid`] when no
    /// centre is in the box.
    pub fn crop_world(&self, min: &Point3<f64>, max: &Point3<f64>) -> Result<Self, VolumeError> {
        for (n, axis) in ['x', 'y', 'z'].into_iter().enumerate() {
            let [from_mm, to_mm] = [min[n], max[n]];
            let in_order = from_mm <= to_mm;
            if !in_order {
                return Err(VolumeError::Reversed {
                    axis,
                    from_mm,
                    to_mm,
                });
            }
        }
        let (low, high) = self
            .grid
            .block_inside(min, max)
            .ok_or(GridError::Empty([0; 3]))?;
        self.crop(low, high)
    }
}

/// The values of the voxels `low..high`.
fn cut<T: Copy>(
    values: &[T],
    grid: &Grid,
    low: [usize; 3],
    high: [usize; 3],
) -> Result<Vec<T>, VolumeError> {
    let length = high[0] - low[0];
    let mut cut = with_room(length * (high[1] - low[1]) * (high[2] - low[2]))?;
    for k in low[2]..high[2] {
        for j in low[1]..high[1] {
            let start = grid.index([low[0], j, k]);
            cut.extend_from_slice(&values[start..start + length]);
        }
    }
    Ok(cut)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Affine3, Matrix4, Rotation3, Vector3};
    use proptest::prelude::*;

    proptest! {
        /// Compared with a search over all voxels, on rotated, sheared and mirrored lattices.
        #[test]
        fn world_crop_is_the_tightest_block_around_the_box(
            size in prop::array::uniform3(1..7_usize),
            angles in prop::array::uniform3(-3.0..3.0_f64),
            (shear, mirror) in (-0.5..0.5_f64, any::<bool>()),
            corner in prop::array::uniform3(-6.0..6.0_f64),
            side in prop::array::uniform3(0.0..9.0_f64),
        ) {
            let mut axes = *Rotation3::from_euler_angles(angles[0], angles[1], angles[2]).matrix();
            let lean = axes.column(1) * shear;
            axes.column_mut(2).axpy(1.0, &lean, 1.0);
            if mirror {
                axes.column_mut(0).neg_mut();
            }
            let matrix: Matrix4<f64> = axes.to_homogeneous();
            let grid = Grid::new(size, Affine3::from_matrix_unchecked(matrix)).unwrap();
            let hu = (0..grid.len()).map(|n| n as f32).collect();
            let volume = Volume::new(grid, hu).unwrap();

            let min = Point3::from(corner);
            let max = min + Vector3::from(side);
            let inside = (0..volume.grid().len()).map(|n| volume.grid().voxel(n)).filter(|v| {
                let centre = volume.grid().centre(v.map(|c| c as f64));
                min <= centre && centre <= max
            }).collect::<Vec<_>>();
            let cropped = volume.crop_world(&min, &max);
            let bound = |axis: usize, pick: fn(usize, usize) -> usize| {
                inside.iter().map(|v| v[axis]).reduce(pick)
            };
            match bound(0, usize::min) {
                None => prop_assert!(cropped.is_err()),
                Some(_) => {
                    let low = [0, 1, 2].map(|axis| bound(axis, usize::min).unwrap());
                    let high = [0, 1, 2].map(|axis| bound(axis, usize::max).unwrap() + 1);
                    prop_assert_eq!(cropped.unwrap(), volume.crop(low, high).unwrap());
                }
            }
        }
    }

    /// Linear in each coordinate, so that trilinear interpolation is exact.
    #[test]
    fn sampling_a_ramp_returns_the_ramp() {
        let grid = Grid::axis_aligned([4, 5, 6], Vector3::new(0.5, 1.0, 2.0), Point3::origin());
        let grid = grid.unwrap();
        let ramp = |p: &Point3<f64>| 3.0 * p.x - 2.0 * p.y + 0.5 * p.z;
        let centres = (0..grid.len()).map(|n| grid.centre(grid.voxel(n).map(|v| v as f64)));
        let hu = centres.map(|p| ramp(&p) as f32).collect();
        let volume = Volume::new(grid, hu).unwrap();
        for p in [
            Point3::new(0.7, 3.9, 9.99),
            Point3::new(1.5, 4.0, 10.0),
            Point3::origin(),
        ] {
            assert!((volume.sample(&p).unwrap() - ramp(&p)).abs() < 1e-6);
        }
        assert_eq!(volume.sample(&Point3::new(1.51, 0.0, 0.0)), None);
    }

    #[test]
    fn a_box_from_the_larger_end_to_the_smaller_is_refused() {
        let grid = Grid::axis_aligned([4, 5, 6], Vector3::repeat(1.0), Point3::origin());
        let volume = Volume::new(grid.unwrap(), vec![0.0; 120]).unwrap();
        let crop = |z: [f64; 2]| {
            let [min, max] = z.map(|z| Point3::new(1.0, 1.0, z));
            volume.crop_world(&min, &max)
        };
        assert!(crop([2.0, 2.0]).is_ok());
        for z in [[3.0, 2.0], [f64::NAN, 2.0], [2.0, f64::NAN]] {
            let refused = crop(z);
            assert!(
                matches!(refused, Err(VolumeError::Reversed { axis: 'z', .. })),
                "{z:?}"
            );
        }
    }
}
