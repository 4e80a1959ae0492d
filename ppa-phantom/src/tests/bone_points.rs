//! Voxels of one bone, and measures derived from them.

use nalgebra::{Matrix3, Point3, Vector3};
use ppa_ct::Grid;

use crate::*;

/// Centres of the voxels of a bone of a right foot, limb frame.
pub(super) fn bone_voxels(leg: &LowerLeg, name: &str, voxel_mm: f64) -> Vec<Point3<f64>> {
    let bone = leg.bone_names().iter().position(|n| *n == name).unwrap();
    let around = leg.skeleton.bones()[bone].solid.bounds();
    let ends = [around.low, around.high];
    let corners = (0..8).map(|n| {
        let corner = Point3::new(ends[n & 1].x, ends[n >> 1 & 1].y, ends[n >> 2].z);
        leg.ct_from_limb * corner
    });
    let (low, high) = corners.fold(
        (Point3::from([f64::MAX; 3]), Point3::from([f64::MIN; 3])),
        |b, p| (b.0.inf(&p), b.1.sup(&p)),
    );
    let size = ((high - low) / voxel_mm).map(|n| n as usize + 1).into();
    let grid = Grid::axis_aligned(size, Vector3::repeat(voxel_mm), low).unwrap();
    let labels = leg.bone_labels(&grid);
    let voxels = (0..grid.len()).filter(|n| usize::from(labels[*n]) == bone + 1);
    voxels
        .map(|n| leg.limb_point(&grid.centre(grid.voxel(n).map(|v| v as f64))))
        .collect()
}

/// Direction in which the spread of points is largest.
pub(super) fn long_axis(points: &[Point3<f64>]) -> Vector3<f64> {
    let count = points.len() as f64;
    let mean = points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / count;
    let spread: Matrix3<f64> = points
        .iter()
        .map(|p| (p.coords - mean) * (p.coords - mean).transpose())
        .sum();
    let eigen = spread.symmetric_eigen();
    eigen
        .eigenvectors
        .column(eigen.eigenvalues.imax())
        .into_owned()
}

/// Length of a bone along its long axis, mm.
pub(super) fn length_mm(leg: &LowerLeg, name: &str) -> f64 {
    const VOXEL_MM: f64 = 0.6;
    let points = bone_voxels(leg, name, VOXEL_MM);
    let axis = long_axis(&points);
    let along = points.iter().map(|p| axis.dot(&p.coords));
    let (least, most) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), a| {
        (least.min(a), most.max(a))
    });
    most - least + VOXEL_MM
}
