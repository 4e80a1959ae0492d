//! Finer voxels by trilinear interpolation.

use nalgebra::{Affine3, Matrix4, Vector4};
use rayon::prelude::*;

use crate::derived_grids::MOST_VOXELS;
use crate::grid::Grid;
use crate::values::{with_room, zeros};
use crate::volume::Volume;
use crate::volume_error::VolumeError;

impl Volume {
    /// Returns the volume with axes coarser than `max_spacing_mm` resampled to at most that spacing.
    ///
    /// The first and the last centre of every axis stay in place, values between centres are interpolated
    /// trilinearly, and axes that are fine enough are kept. This adds no information, but avoids the staircase of thick slices.
    ///
    /// # Errors
    /// [`VolumeError::Spacing`] unless `max_spacing_mm` is above 0, [`VolumeError::TooFine`] for more
    /// than 2^32 voxels, [`VolumeError::Memory`] if they do not fit.
    pub fn refined(&self, max_spacing_mm: f64) -> Result<Self, VolumeError> {
        if max_spacing_mm.is_nan() || max_spacing_mm <= 0.0 {
            return Err(VolumeError::Spacing(max_spacing_mm));
        }
        let size = self.grid().size();
        let spacing = self.grid().spacing_mm();
        let fine = [0, 1, 2].map(|axis| {
            let steps = (size[axis] - 1) as f64;
            // A small tolerance keeps an axis that is exactly fine enough.
            let needed = (steps * spacing[axis] / max_spacing_mm - 1e-9).ceil();
            (needed.max(steps) as usize).saturating_add(1)
        });
        if fine == size {
            return Ok(self.clone());
        }
        let voxels = fine.map(|n| n as f64).iter().product();
        if voxels > MOST_VOXELS {
            return Err(VolumeError::TooFine {
                spacing_mm: max_spacing_mm,
                voxels,
                most: MOST_VOXELS,
            });
        }
        let scale = [0, 1, 2].map(|axis| match fine[axis] {
            1 => 1.0,
            count => (size[axis] - 1) as f64 / (count - 1) as f64,
        });
        let coarse_from_fine =
            Matrix4::from_diagonal(&Vector4::new(scale[0], scale[1], scale[2], 1.0));
        let ct_from_fine = self.grid().ct_from_voxel().matrix() * coarse_from_fine;
        let grid = Grid::new(fine, Affine3::from_matrix_unchecked(ct_from_fine))?;
        let [along_i, along_j, along_k] =
            [0, 1, 2].map(|axis| weights(size[axis], fine[axis], scale[axis]));
        let axes = [along_i?, along_j?, along_k?];
        let mut hu = zeros(grid.len())?;
        hu.par_chunks_mut(fine[0])
            .enumerate()
            .for_each(|(row, values)| {
                let (j, k) = (&axes[1][row % fine[1]], &axes[2][row / fine[1]]);
                let rows = [(j.0, k.0), (j.1, k.0), (j.0, k.1), (j.1, k.1)].map(|(j, k)| {
                    let start = self.grid().index([0, j, k]);
                    self.values().part(start..start + size[0]).to_f32()
                });
                for (value, i) in values.iter_mut().zip(&axes[0]) {
                    let [a, b, c, d] = rows
                        .each_ref()
                        .map(|row| row[i.0] + (row[i.1] - row[i.0]) * i.2);
                    let (front, back) = (a + (b - a) * j.2, c + (d - c) * j.2);
                    *value = front + (back - front) * k.2;
                }
            });
        Self::new(grid, hu)
    }
}

/// For each fine sample, the two coarse ones around it and the weight of the second.
fn weights(
    coarse: usize,
    fine: usize,
    scale: f64,
) -> Result<Vec<(usize, usize, f32)>, VolumeError> {
    let last = coarse - 1;
    let at = |n: usize| {
        let position = n as f64 * scale;
        let base = (position as usize).min(last);
        (base, (base + 1).min(last), (position - base as f64) as f32)
    };
    let mut weights = with_room(fine)?;
    weights.extend((0..fine).map(at));
    Ok(weights)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};
    use proptest::prelude::*;

    use super::*;

    fn volume(size: [usize; 3], spacing: [f64; 3], hu: impl Fn(Point3<f64>) -> f64) -> Volume {
        let origin = Point3::new(-7.0, 11.0, 3.0);
        let grid = Grid::axis_aligned(size, Vector3::from(spacing), origin).unwrap();
        let centre = |index| grid.centre(grid.voxel(index).map(|v| v as f64));
        let values = (0..grid.len())
            .map(|index| hu(centre(index)) as f32)
            .collect();
        Volume::new(grid.clone(), values).unwrap()
    }

    proptest! {
        /// Trilinear interpolation is exact for linear fields, wherever the voxels are.
        #[test]
        fn a_linear_field_stays_itself(
            size in [1_usize..6, 1..6, 2..6],
            spacing in [0.4..4.0_f64, 0.4..4.0, 0.4..4.0],
            slope in [-30.0..30.0_f64, -30.0..30.0, -30.0..30.0],
            max_mm in 0.3..3.0_f64,
        ) {
            let field = |p: Point3<f64>| Vector3::from(slope).dot(&p.coords);
            let fine = volume(size, spacing, field).refined(max_mm).unwrap();
            let grid = fine.grid();
            for (count, spacing) in grid.size().into_iter().zip(&grid.spacing_mm()) {
                prop_assert!(count == 1 || *spacing <= max_mm + 1e-6);
            }
            for (index, &hu) in fine.hu().iter().enumerate() {
                let expected = field(grid.centre(grid.voxel(index).map(|v| v as f64)));
                prop_assert!((f64::from(hu) - expected).abs() < 1e-2, "{hu} {expected}");
            }
        }
    }

    #[test]
    fn ends_stay_and_fine_axes_are_kept() {
        let coarse = volume([4, 3, 5], [1.0, 1.0, 3.27], |p| {
            (p.x * 3.0 + p.z).sin() * 500.0
        });
        let fine = coarse.refined(1.0).unwrap();
        assert_eq!(fine.grid().size(), [4, 3, 15]);
        assert_eq!(fine.grid().origin_mm(), coarse.grid().origin_mm());
        assert_eq!(fine.at([3, 2, 14]), coarse.at([3, 2, 4]));
        assert_eq!(coarse.refined(5.0).unwrap(), coarse);
        assert!(matches!(coarse.refined(0.0), Err(VolumeError::Spacing(_))));
        for hopeless in [1e-3, 1e-300] {
            let refused = coarse.refined(hopeless);
            assert!(matches!(refused, Err(VolumeError::TooFine { .. })));
        }
    }
}
