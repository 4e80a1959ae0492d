//! From the lattice to the world.

use nalgebra::{Affine3, Matrix3, Point3, Vector3};
use ppa_ct::Grid;

/// Where points and gradients of a lattice lie in the world.
pub struct World {
    /// mm from voxel indices of the field.
    affine: Affine3<f64>,
    /// Outward covectors from gradients.
    outward: Matrix3<f32>,
    /// Whether the map turns right hands into left ones.
    pub mirrored: bool,
}

impl World {
    /// For a field whose first lattice point is the voxel `origin` of the grid.
    pub fn new(grid: &Grid, origin: Vector3<f64>) -> Self {
        let affine = *grid.ct_from_voxel();
        let linear: Matrix3<f64> = affine.matrix().fixed_view::<3, 3>(0, 0).into_owned();
        // A gradient is a covector: it maps with the inverse transpose. Outward is down the gradient.
        let outward = -linear.try_inverse().unwrap_or_default().transpose();
        let shift = nalgebra::Translation3::from(origin);
        Self {
            affine: affine * nalgebra::convert::<_, Affine3<f64>>(shift),
            outward: outward.cast(),
            mirrored: linear.determinant() < 0.0,
        }
    }

    /// mm.
    pub fn point(&self, voxel: Vector3<f64>) -> Point3<f32> {
        let m = self.affine.matrix();
        let row =
            |r: usize| m[(r, 0)] * voxel.x + m[(r, 1)] * voxel.y + m[(r, 2)] * voxel.z + m[(r, 3)];
        Point3::new(row(0) as f32, row(1) as f32, row(2) as f32)
    }

    /// Unit vector towards lower HU; zero for a gradient (HU per voxel step) of zero.
    pub fn normal(&self, gradient: Vector3<f32>) -> Vector3<f32> {
        let normal = self.outward * gradient;
        normal.try_normalize(0.0).unwrap_or_default()
    }
}
