//! The lattice of voxel centres: size, spacing, position and orientation.

use nalgebra::{Affine3, Matrix3, Matrix4, Point3, Vector3};

/// Why a lattice is unusable.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GridError {
    /// At least one side has no voxels.
    #[error("a volume of {} x {} x {} voxels is empty; expected at least one along each axis", .0[0], .0[1], .0[2])]
    Empty([usize; 3]),
    /// A block that reaches beyond the lattice.
    #[error(
        "a block ends before voxel {end} along {axis}, but the volume has only {voxels} along that axis"
    )]
    Outside {
        /// i, j or k.
        axis: char,
        /// Half-open end of the block along that axis.
        end: usize,
        /// Voxels of the volume along that axis.
        voxels: usize,
    },
    /// More voxels than the machine's integers can count.
    #[error("a volume of {} x {} x {} voxels, expected at most {most} voxels", .0[0], .0[1], .0[2], most = usize::MAX)]
    TooMany([usize; 3]),
    /// The axes are in one plane up to rounding, or the affine or its inverse is not finite.
    #[error("the voxel-to-world affine is singular or not finite (determinant {determinant})")]
    Singular {
        /// Determinant of the 3x3 part, mm³.
        determinant: f64,
    },
}

/// Smallest volume of a voxel, as a share of the block with the same edges at right angles: axes in one plane are below
/// it up to rounding, and the most sheared lattice in practice is far above.
const LEAST_SHARE: f64 = 1e-6;

/// A regular lattice of voxel centres in the `ct` frame (LPS, mm).
///
/// The affine may shear (gantry tilt) and may be left-handed; it is kept exactly as read.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    size: [usize; 3],
    ct_from_voxel: Affine3<f64>,
}

impl Grid {
    /// A lattice of `size` voxels (i, j, k) with centres at `ct_from_voxel * (i, j, k)`.
    ///
    /// # Errors
    /// [`GridError`] when a side is 0, the voxels are too many to count or the affine is singular.
    pub fn new(size: [usize; 3], ct_from_voxel: Affine3<f64>) -> Result<Self, GridError> {
        if size.contains(&0) {
            return Err(GridError::Empty(size));
        }
        let count = |n: usize, side: &usize| n.checked_mul(*side);
        if size.iter().try_fold(1, count).is_none() {
            return Err(GridError::TooMany(size));
        }
        let linear = ct_from_voxel.matrix().fixed_view::<3, 3>(0, 0);
        let determinant = linear.determinant();
        let block = linear
            .column_iter()
            .map(|axis| axis.norm())
            .product::<f64>();
        // False for NaN and for infinity over infinity.
        let solid = determinant.abs() > LEAST_SHARE * block;
        let finite = |affine: Affine3<f64>| affine.matrix().iter().all(|v| v.is_finite());
        if !(solid && finite(ct_from_voxel) && ct_from_voxel.try_inverse().is_some_and(finite)) {
            return Err(GridError::Singular { determinant });
        }
        Ok(Self {
            size,
            ct_from_voxel,
        })
    }

    /// An unrotated lattice: axes along LPS, `spacing_mm` apart, first centre at `origin_mm`.
    ///
    /// # Errors
    /// The same as [`Grid::new`].
    pub fn axis_aligned(
        size: [usize; 3],
        spacing_mm: Vector3<f64>,
        origin_mm: Point3<f64>,
    ) -> Result<Self, GridError> {
        Self::from_parts(size, Matrix3::identity(), spacing_mm, origin_mm)
    }

    /// A lattice from unit axis directions (columns), spacing and first centre.
    ///
    /// # Errors
    /// The same as [`Grid::new`].
    pub fn from_parts(
        size: [usize; 3],
        direction: Matrix3<f64>,
        spacing_mm: Vector3<f64>,
        origin_mm: Point3<f64>,
    ) -> Result<Self, GridError> {
        let mut matrix = Matrix4::identity();
        matrix
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(direction * Matrix3::from_diagonal(&spacing_mm)));
        matrix
            .fixed_view_mut::<3, 1>(0, 3)
            .copy_from(&origin_mm.coords);
        Self::new(size, Affine3::from_matrix_unchecked(matrix))
    }

    /// Voxels along i, j, k.
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// Number of voxels.
    pub fn len(&self) -> usize {
        self.size.iter().product()
    }

    /// Always false: a grid has at least one voxel.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Linear index of voxel (i, j, k), i fastest.
    pub fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.size[0] * (j + self.size[1] * k)
    }

    /// Voxel (i, j, k) at a linear index; the inverse of [`Grid::index`].
    pub fn voxel(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.size;
        [index % nx, index / nx % ny, index / (nx * ny)]
    }

    /// The affine from voxel indices to the `ct` frame.
    pub fn ct_from_voxel(&self) -> &Affine3<f64> {
        &self.ct_from_voxel
    }

    /// The affine from the `ct` frame to (fractional) voxel indices.
    pub fn voxel_from_ct(&self) -> Affine3<f64> {
        self.ct_from_voxel.inverse()
    }

    /// Centre of a (fractional) voxel in the `ct` frame.
    pub fn centre(&self, voxel: [f64; 3]) -> Point3<f64> {
        self.ct_from_voxel * Point3::from(voxel)
    }

    fn linear(&self) -> Matrix3<f64> {
        self.ct_from_voxel
            .matrix()
            .fixed_view::<3, 3>(0, 0)
            .into_owned()
    }

    /// Distance between neighbouring centres along i, j, k in mm.
    pub fn spacing_mm(&self) -> Vector3<f64> {
        let linear = self.linear();
        Vector3::from_fn(|axis, _| linear.column(axis).norm())
    }

    /// Unit directions of the i, j, k axes in LPS, as columns.
    pub fn direction(&self) -> Matrix3<f64> {
        let mut linear = self.linear();
        for mut column in linear.column_iter_mut() {
            column.normalize_mut();
        }
        linear
    }

    /// Centre of the first voxel in the `ct` frame, mm.
    pub fn origin_mm(&self) -> Point3<f64> {
        self.centre([0.0; 3])
    }

    /// The sub-lattice of voxels `low..high` (half-open on every axis), at the same world positions.
    ///
    /// # Errors
    /// [`GridError::Outside`] when the range exceeds the lattice, [`GridError::Empty`] when it is empty.
    pub fn crop(&self, low: [usize; 3], high: [usize; 3]) -> Result<Self, GridError> {
        for ((end, voxels), axis) in high.into_iter().zip(self.size).zip(['i', 'j', 'k']) {
            if end > voxels {
                return Err(GridError::Outside { axis, end, voxels });
            }
        }
        let mut matrix = *self.ct_from_voxel.matrix();
        let origin = self.centre(low.map(|v| v as f64));
        matrix
            .fixed_view_mut::<3, 1>(0, 3)
            .copy_from(&origin.coords);
        Self::new(
            [0, 1, 2].map(|axis| high[axis].saturating_sub(low[axis])),
            Affine3::from_matrix_unchecked(matrix),
        )
    }

    /// Half-open bounds of the voxels whose centres lie in the world box `min..=max`.
    pub(crate) fn block_inside(
        &self,
        min: &Point3<f64>,
        max: &Point3<f64>,
    ) -> Option<([usize; 3], [usize; 3])> {
        /// Centres on the faces of the box are inside despite rounding, in voxels.
        const SLACK: f64 = 1e-9;
        let [nx, ny, nz] = self.size;
        let along_i = self.linear().column(0).into_owned();
        let (mut low, mut high) = (self.size, [0; 3]);
        for k in 0..nz {
            for j in 0..ny {
                let start = self.centre([0.0, j as f64, k as f64]);
                let (mut first, mut last) = (0.0_f64, (nx - 1) as f64);
                for axis in 0..3 {
                    let (to_min, to_max) = (min[axis] - start[axis], max[axis] - start[axis]);
                    let step = along_i[axis];
                    if step.abs() < 1e-12 {
                        if to_min > SLACK || to_max < -SLACK {
                            last = -1.0;
                        }
                        continue;
                    }
                    let (a, b) = (to_min / step, to_max / step);
                    first = first.max((a.min(b) - SLACK).ceil());
                    last = last.min((a.max(b) + SLACK).floor());
                }
                if first <= last {
                    let block = [(first as usize, last as usize), (j, j), (k, k)];
                    for (axis, (from, to)) in block.into_iter().enumerate() {
                        low[axis] = low[axis].min(from);
                        high[axis] = high[axis].max(to + 1);
                    }
                }
            }
        }
        (high[0] > 0).then_some((low, high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_axes(axes: [[f64; 3]; 3]) -> Result<Grid, GridError> {
        let axes = axes.map(Vector3::from);
        let matrix = Matrix3::from_columns(&axes).to_homogeneous();
        Grid::new([2, 2, 2], Affine3::from_matrix_unchecked(matrix))
    }

    /// Axes in one plane have a determinant from rounding; axes of 1e200 mm overflow it, those of 1e-200 mm underflow it.
    #[test]
    fn axes_without_an_inverse_are_refused_whatever_their_length() {
        let plane = [
            [354.9, 864.5, 1219.4],
            [691.6, 363.3, 1054.9],
            [47.6, 717.5, 765.1],
        ];
        for scale in [1e200, 1e103, 1.0, 1e-3, 1e-200] {
            let [large, flat] = [Matrix3::identity(), Matrix3::from(plane)]
                .map(|m| of_axes(<[[f64; 3]; 3]>::from(m * scale)));
            let refused = |grid| matches!(grid, Err(GridError::Singular { .. }));
            assert!(refused(flat), "{scale}");
            assert_eq!(refused(large), !(1e-9..=1e9).contains(&scale), "{scale}");
        }
        for bad in [f64::NAN, f64::INFINITY, 0.0] {
            let grid = of_axes([[bad, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
            assert!(matches!(grid, Err(GridError::Singular { .. })), "{bad}");
        }
        // Micrometres, and a tilt far beyond that of any gantry.
        assert!(of_axes([[1e-5, 0.0, 0.0], [0.0, 1e-5, 0.0], [0.0, 1.0, 1e-4]]).is_ok());
    }

    #[test]
    fn blocks_that_leave_the_lattice_or_are_empty_are_refused() {
        let (size, one) = ([4, 5, 6], Vector3::repeat(1.0));
        let grid = Grid::axis_aligned(size, one, Point3::origin()).unwrap();
        assert_eq!(grid.crop([0; 3], size), Ok(grid.clone()));
        let (axis, end, voxels) = ('j', 9, 5);
        let outside = grid.crop([0; 3], [4, 9, 6]);
        assert_eq!(outside, Err(GridError::Outside { axis, end, voxels }));
        for (low, cut) in [([1, 2, 3], [2, 0, 0]), ([3, 0, 0], [0, 2, 3])] {
            assert_eq!(grid.crop(low, [3, 2, 3]), Err(GridError::Empty(cut)));
        }
    }

    #[test]
    fn more_voxels_than_can_be_counted_are_refused() {
        let side = 1 << (usize::BITS / 3 + 1);
        let grid = Grid::axis_aligned([side; 3], Vector3::repeat(1.0), Point3::origin());
        assert_eq!(grid, Err(GridError::TooMany([side; 3])));
    }
}
