//! From the lattice to the world.

use nalgebra::{Affine3, Matrix3, Point3, Vector3};
use ppa_ct::Grid;

/// Maps points and gradients of a lattice to the world.
pub struct World {
    /// mm from voxel indices of the field.
    affine: Affine3<f64>,
    /// Outward covectors from gradients.
    outward: Matrix3<f32>,
    /// Whether the map reverses handedness.
    pub mirrored: bool,
    /// Crossings nearer to a voxel than this fraction of an edge are moved away from it: in f32 they
    /// could coincide with one on another edge of that voxel.
    pub nearest: f64,
}

/// [`World::nearest`] unless the volume is so far from the origin that f32 needs more.
const NEAREST: f64 = 1e-4;

impl World {
    /// For a field whose first lattice point is the voxel `origin` of the grid, at most one voxel outside.
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
            nearest: NEAREST.max(resolved_fraction(grid)),
        }
    }

    /// Position of a voxel index in the world, mm.
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

    /// [`World::point`] of several places, by component.
    pub fn points<const N: usize>(&self, voxel: &[[f64; N]; 3]) -> [[f32; N]; 3] {
        let m = self.affine.matrix();
        let mut points = [[0.0; N]; 3];
        for (r, row) in points.iter_mut().enumerate() {
            let [x, y, z, shift] = [0, 1, 2, 3].map(|c| m[(r, c)]);
            for (n, value) in row.iter_mut().enumerate() {
                *value = (x * voxel[0][n] + y * voxel[1][n] + z * voxel[2][n] + shift) as f32;
            }
        }
        points
    }

    /// [`World::normal`] of several gradients, by component.
    pub fn normals<const N: usize>(&self, gradient: &[[f32; N]; 3]) -> [[f32; N]; 3] {
        let m = &self.outward;
        let mut normals = [[0.0; N]; 3];
        for (r, row) in normals.iter_mut().enumerate() {
            let [x, y, z] = [0, 1, 2].map(|c| m[(r, c)]);
            for (n, value) in row.iter_mut().enumerate() {
                *value = x * gradient[0][n] + y * gradient[1][n] + z * gradient[2][n];
            }
        }
        let [x, y, z] = &mut normals;
        for n in 0..N {
            let length = (x[n] * x[n] + y[n] * y[n] + z[n] * z[n]).sqrt();
            let unit = |value: f32| if length > 0.0 { value / length } else { 0.0 };
            (x[n], y[n], z[n]) = (unit(x[n]), unit(y[n]), unit(z[n]));
        }
        normals
    }
}

/// The fraction of the shortest edge that moves a point by two steps of f32 along some axis, anywhere in the
/// volume; at most a quarter.
fn resolved_fraction(grid: &Grid) -> f64 {
    let last = grid.size().map(|n| n as f64);
    let corners = (0..8).map(|corner: usize| {
        let end = |axis: usize| {
            if corner >> axis & 1 == 1 {
                last[axis]
            } else {
                -1.0
            }
        };
        grid.centre([end(0), end(1), end(2)])
    });
    let farthest = corners.fold(0.0_f64, |most, p| most.max(p.coords.amax()));
    let step = farthest * f64::from(f32::EPSILON);
    // An edge has at least 1/sqrt(3) of its length along one axis.
    (2.0 * 3_f64.sqrt() * step / grid.spacing_mm().min()).min(0.25)
}
