//! Volumes to write and read back.

use nalgebra::{Affine3, Matrix3, Matrix4, Point3, Rotation3, Vector3};
use ppa_ct::{Grid, Volume};
use proptest::prelude::*;

/// Volumes with any rotation, handedness, shear and odd sizes; whole or fractional values.
pub fn volumes() -> impl Strategy<Value = Volume> {
    (
        prop::array::uniform3(1..8_usize),
        prop::array::uniform3(-4.0..4.0_f64),
        prop::array::uniform3(0.05..5.0_f64),
        prop::array::uniform3(-1500.0..1500.0_f64),
        prop_oneof![Just(0.0), -0.4..0.4_f64],
        any::<[bool; 3]>(),
        any::<bool>(),
        any::<u32>(),
    )
        .prop_map(
            |(size, angles, spacing, origin, shear, mirrored, whole, seed)| {
                let mut axes = Rotation3::from_euler_angles(angles[0], angles[1], angles[2])
                    .matrix()
                    * Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, shear, 0.0, 0.0, 1.0);
                for (axis, mirrored) in mirrored.into_iter().enumerate() {
                    let sign = if mirrored { -1.0 } else { 1.0 };
                    axes.column_mut(axis).scale_mut(sign * spacing[axis]);
                }
                let mut matrix = axes.to_homogeneous();
                for (row, v) in origin.into_iter().enumerate() {
                    matrix[(row, 3)] = v;
                }
                let grid = Grid::new(size, Affine3::from_matrix_unchecked(matrix)).unwrap();
                let value = |n: usize| {
                    let noise = (n as u32).wrapping_mul(2_654_435_761).wrapping_add(seed);
                    let hu = (noise % 4096) as f32 - 1024.0;
                    if whole { hu } else { hu + 0.37 }
                };
                let hu = (0..grid.len()).map(value).collect();
                Volume::new(grid, hu).unwrap()
            },
        )
}

/// Twelve voxels of −1000 to −989 HU.
pub fn small() -> Volume {
    let grid = Grid::axis_aligned(
        [3, 2, 2],
        Vector3::new(1.0, 2.0, 3.0),
        Point3::new(-5.0, 6.0, 7.0),
    );
    let hu = (0..12).map(|n| n as f32 - 1000.0).collect();
    Volume::new(grid.unwrap(), hu).unwrap()
}

/// Largest difference between the entries of two affines.
pub fn max_abs(a: &Matrix4<f64>, b: &Matrix4<f64>) -> f64 {
    (a - b).amax()
}
