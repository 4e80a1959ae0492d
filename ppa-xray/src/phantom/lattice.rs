//! Straight rays through a regular lattice of cells.

use nalgebra::{Isometry3, Matrix3, Matrix4, Point3, Vector3};
use ppa_ct::Grid;

/// The voxel box of a phantom as seen from the device.
///
/// Cell space counts voxels from the corner of the box: voxel i spans [i, i + 1). The map from the
/// device frame is affine and may shear; a ray keeps its parameter, which is mm in the device frame.
#[derive(Debug, Clone)]
pub(crate) struct Lattice {
    pub size: [usize; 3],
    linear: Matrix3<f64>,
    offset: Vector3<f64>,
}

/// A ray in cell space: cells per mm of device length.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ray {
    pub origin: Vector3<f64>,
    pub slope: Vector3<f64>,
}

impl Ray {
    /// The same ray in units of cubes of `edge` cells.
    #[inline]
    pub fn shrunk(&self, edge: usize) -> Self {
        let shrink = 1.0 / edge as f64;
        Self {
            origin: self.origin * shrink,
            slope: self.slope * shrink,
        }
    }
}

impl Lattice {
    pub fn new(grid: &Grid, ct_from_device: &Isometry3<f64>) -> Self {
        let cell_from_device =
            grid.voxel_from_ct().to_homogeneous() * ct_from_device.to_homogeneous();
        Self {
            size: grid.size(),
            linear: cell_from_device.fixed_view::<3, 3>(0, 0).into_owned(),
            offset: cell_from_device.fixed_view::<3, 1>(0, 3).add_scalar(0.5),
        }
    }

    /// Transform from mm in the device frame to cells.
    pub fn cell_from_device(&self) -> Matrix4<f64> {
        let mut matrix = self.linear.to_homogeneous();
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&self.offset);
        matrix
    }

    /// Transform from cells to mm in the device frame.
    pub fn device_from_cell(&self) -> Matrix4<f64> {
        self.cell_from_device()
            .try_inverse()
            .expect("the grid of a volume is invertible")
    }

    #[inline]
    pub fn ray(&self, from_mm: &Point3<f64>, direction: &Vector3<f64>) -> Ray {
        Ray {
            origin: self.linear * from_mm.coords + self.offset,
            slope: self.linear * direction,
        }
    }

    /// Part of the ray inside the box: entry and exit in mm, with entry not below 0.
    #[inline]
    pub fn clip(&self, ray: &Ray) -> Option<(f64, f64)> {
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let (origin, slope) = (ray.origin[axis], ray.slope[axis]);
            let far = self.size[axis] as f64;
            if slope == 0.0 {
                if !(0.0..far).contains(&origin) {
                    return None;
                }
                continue;
            }
            let (a, b) = (-origin / slope, (far - origin) / slope);
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        (enter < leave).then_some((enter, leave))
    }
}

/// Traversal from cell to cell (Amanatides and Woo, Eurographics 1987), with cubes of `edge` voxels as cells.
#[derive(Debug, Clone)]
pub(crate) struct Walk {
    /// Current cell; an axis that has left the lattice holds a number ≥ its count.
    pub cell: [u32; 3],
    /// Linear index of the current cell, first axis fastest.
    pub index: usize,
    next_mm: [f64; 3],
    pitch_mm: [f64; 3],
    step: [u32; 3],
    stride: [usize; 3],
    count: [u32; 3],
}

impl Walk {
    /// Starts in the cell that contains the ray at `start_mm`, which must be in the box.
    #[inline]
    pub fn new(ray: &Ray, start_mm: f64, count: [u32; 3], edge: f64) -> Self {
        let mut walk = Self {
            cell: [0; 3],
            index: 0,
            next_mm: [f64::INFINITY; 3],
            pitch_mm: [f64::INFINITY; 3],
            step: [0; 3],
            stride: [0; 3],
            count,
        };
        let mut stride = 1;
        for (axis, &cells) in count.iter().enumerate() {
            let (origin, slope) = (ray.origin[axis], ray.slope[axis]);
            let at = (origin + slope * start_mm) / edge;
            let cell = (at as u32).min(cells - 1);
            walk.cell[axis] = cell;
            walk.index += cell as usize * stride;
            if slope != 0.0 {
                let forward = slope > 0.0;
                let face = f64::from(cell + u32::from(forward)) * edge;
                let inverse = 1.0 / slope;
                walk.next_mm[axis] = (face - origin) * inverse;
                walk.pitch_mm[axis] = edge * inverse.abs();
                walk.step[axis] = if forward { 1 } else { u32::MAX };
                walk.stride[axis] = if forward {
                    stride
                } else {
                    stride.wrapping_neg()
                };
            }
            stride *= cells as usize;
        }
        walk
    }

    /// The axis along which the ray leaves the current cell, and the ray parameter at that point, mm.
    #[inline]
    pub fn exit(&self) -> (usize, f64) {
        let [x, y, z] = self.next_mm;
        if x < y {
            if x < z { (0, x) } else { (2, z) }
        } else if y < z {
            (1, y)
        } else {
            (2, z)
        }
    }

    /// Enters the neighbour along `axis`; returns false once outside the lattice.
    #[inline]
    pub fn advance(&mut self, axis: usize) -> bool {
        self.cell[axis] = self.cell[axis].wrapping_add(self.step[axis]);
        self.index = self.index.wrapping_add(self.stride[axis]);
        self.next_mm[axis] += self.pitch_mm[axis];
        self.cell[axis] < self.count[axis]
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Affine3;
    use proptest::prelude::*;

    use super::*;

    fn sheared_grid() -> Grid {
        #[rustfmt::skip]
        let matrix = Matrix4::new(
            0.8, 0.1, 0.0, -12.0,
            0.0, 1.3, 0.4, -20.0,
            0.05, 0.0, -2.0, 25.0,
            0.0, 0.0, 0.0, 1.0,
        );
        Grid::new([30, 31, 25], Affine3::from_matrix_unchecked(matrix)).unwrap()
    }

    proptest! {
        /// The pieces add up to the chord, and the midpoint of each piece is in the cell that it is assigned to.
        #[test]
        fn pieces_of_a_ray_lie_in_their_cells(
            from in prop::array::uniform3(-60.0..60.0_f64),
            to in prop::array::uniform3(-15.0..15.0_f64),
        ) {
            let lattice = Lattice::new(&sheared_grid(), &Isometry3::identity());
            let (from, to) = (Point3::from(from), Point3::from(to));
            prop_assume!((to - from).norm() > 1e-3);
            let ray = lattice.ray(&from, &(to - from).normalize());
            let Some((enter, leave)) = lattice.clip(&ray) else { return Ok(()) };
            let mut walk = Walk::new(&ray, enter, lattice.size.map(|n| n as u32), 1.0);
            let (mut at, mut sum) = (enter, 0.0);
            loop {
                let (axis, next) = walk.exit();
                let end = next.min(leave);
                let middle = ray.origin + ray.slope * (0.5 * (at + end));
                for (axis, &cell) in walk.cell.iter().enumerate() {
                    prop_assert!((middle[axis] - f64::from(cell) - 0.5).abs() < 0.5 + 1e-9);
                }
                let [i, j, k] = walk.cell.map(|c| c as usize);
                prop_assert_eq!(walk.index, i + 30 * (j + 31 * k));
                sum += end - at;
                at = end;
                if next >= leave || !walk.advance(axis) { break; }
            }
            prop_assert!((sum - (leave - enter)).abs() < 1e-9);
        }
    }

    #[test]
    fn a_ray_that_misses_is_reported_so() {
        let lattice = Lattice::new(&sheared_grid(), &Isometry3::identity());
        let ray = lattice.ray(&Point3::new(100.0, 0.0, 0.0), &Vector3::z());
        assert!(lattice.clip(&ray).is_none());
    }
}
