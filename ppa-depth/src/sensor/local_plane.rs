//! Planes fitted to the surroundings of the pixels of a noisy depth image.

use nalgebra::{Matrix3, Vector3};

use crate::camera::projection::Camera;

/// Pixels from the middle of a window to its border.
const REACH: usize = 4;
/// Smallest number of pixels with a depth, half of a window.
const LEAST_PIXELS: usize = 41;
/// Root mean square deviation from a plane, mm, that a window may have besides noise.
const UNEVEN_MM: f64 = 2.0;

/// A depth and its variance: of the mean of several frames.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MeanDepth {
    /// Mean depth, mm; 0 for a pixel without one.
    pub z_mm: f64,
    /// Variance of the mean, mm²; `None` if it is unknown.
    pub variance_mm2: Option<f64>,
    /// Number of frames with a depth.
    pub frames: usize,
}

/// The plane at a pixel.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LocalPlane {
    /// Its depth at the pixel, mm.
    pub z_mm: f64,
    /// Cosine of the angle between its normal and the pixel's ray.
    pub cos_incidence: f64,
}

/// Fits a plane to the window of 9 x 9 pixels around a pixel. `None` if too few of them have a depth, or if they deviate from a plane
/// by more than their noise and 2 mm explain, as at edges.
///
/// A plane n · P = d has 1/z = n · (x, y, 1) / d along the rays (x, y, 1), which is linear in n / d. The differences of
/// neighbouring pixels would give a normal too: with noise of 3 mm at 2 m, where pixels are 4 mm apart, it would be random.
pub(crate) fn local_plane(
    camera: &Camera,
    depths: &[MeanDepth],
    pixel: usize,
) -> Option<LocalPlane> {
    let (width, height) = (camera.width() as usize, camera.height() as usize);
    let (column, row) = (pixel % width, pixel / width);
    let middle = camera.rays()[pixel]?;
    let window = || {
        let rows = row.saturating_sub(REACH)..(row + REACH + 1).min(height);
        let columns = column.saturating_sub(REACH)..(column + REACH + 1).min(width);
        let pixels = rows.flat_map(move |row| columns.clone().map(move |c| row * width + c));
        pixels.filter_map(|pixel| {
            let (ray, depth) = (camera.rays()[pixel]?, depths[pixel]);
            let offset = ray - middle;
            (depth.z_mm > 0.0).then(|| (Vector3::new(offset.x, offset.y, 1.0), depth))
        })
    };
    // Normal equations of the least squares.
    let (mut matrix, mut right_side, mut count) = (Matrix3::zeros(), Vector3::zeros(), 0);
    let (mut variance_mm2, mut known) = (0.0, 0);
    for (at, depth) in window() {
        matrix += at * at.transpose();
        right_side += at / depth.z_mm;
        count += 1;
        if let Some(one) = depth.variance_mm2 {
            variance_mm2 += one;
            known += 1;
        }
    }
    if count < LEAST_PIXELS {
        return None;
    }
    let plane = matrix.cholesky()?.solve(&right_side);
    let square = |(at, depth): (Vector3<f64>, MeanDepth)| {
        let fitted = plane.dot(&at);
        ((1.0 / depth.z_mm - fitted) / (fitted * fitted)).powi(2)
    };
    let found_mm2 = window().map(square).sum::<f64>() / (count - 3) as f64;
    // The variance of a mean of 81 squares is far less than a factor of 2.
    let expected_mm2 = 2.0 * variance_mm2 / f64::from(known.max(1)) + UNEVEN_MM * UNEVEN_MM;
    let inverse_z = plane.z;
    if inverse_z <= 0.0 || found_mm2.is_nan() || found_mm2 > expected_mm2 {
        return None;
    }
    // n / d of the plane, from its slopes and its value at the middle.
    let of_axis = inverse_z - plane.x * middle.x - plane.y * middle.y;
    let normal = Vector3::new(plane.x, plane.y, of_axis).norm();
    let ray = (1.0 + middle.norm_squared()).sqrt();
    Some(LocalPlane {
        z_mm: 1.0 / inverse_z,
        cos_incidence: inverse_z / (normal * ray),
    })
}
