//! The surface in a depth image: points and angles of incidence.

use nalgebra::{Point3, Vector3};

use crate::camera::Camera;
use crate::image::DepthImage;
use crate::sampled::EDGE_MM;

/// A depth image with the camera that took it.
pub(crate) struct Surface<'a> {
    camera: &'a Camera,
    image: &'a DepthImage,
}

impl<'a> Surface<'a> {
    pub(crate) fn new(camera: &'a Camera, image: &'a DepthImage) -> Self {
        Self { camera, image }
    }

    /// Point in the camera frame that a pixel sees, mm.
    #[inline]
    pub(crate) fn point(&self, pixel: usize) -> Option<Point3<f64>> {
        let z_mm = self.image.z_mm[pixel];
        let ray = self.camera.rays()[pixel]?;
        let z = f64::from(z_mm);
        (z_mm > 0.0).then(|| Point3::new(ray.x * z, ray.y * z, z))
    }

    /// Points of the neighbours left, right, above and below that lie on the same surface.
    #[inline]
    fn neighbours(&self, pixel: usize) -> [Option<Point3<f64>>; 4] {
        let (width, count) = (self.image.width as usize, self.image.z_mm.len());
        let column = pixel % width;
        let on_surface = |exists: bool, other: usize| {
            let other = if exists { other } else { pixel };
            let apart = (self.image.z_mm[other] - self.image.z_mm[pixel]).abs();
            self.point(other).filter(|_| exists && apart <= EDGE_MM)
        };
        [
            on_surface(column > 0, pixel.wrapping_sub(1)),
            on_surface(column + 1 < width, pixel + 1),
            on_surface(pixel >= width, pixel.wrapping_sub(width)),
            on_surface(pixel + width < count, pixel + width),
        ]
    }

    /// Whether a pixel and its four neighbours lie on one surface.
    pub(crate) fn is_smooth(&self, pixel: usize) -> bool {
        self.image.z_mm[pixel] > 0.0 && self.neighbours(pixel).iter().all(Option::is_some)
    }

    /// Unit normal towards the camera, from the neighbours on the same surface; `None` if there are too few.
    #[inline]
    pub(crate) fn normal(&self, pixel: usize) -> Option<Vector3<f64>> {
        let here = self.point(pixel)?;
        let across = |behind: Option<Point3<f64>>, ahead: Option<Point3<f64>>| match (behind, ahead)
        {
            (None, None) => None,
            (behind, ahead) => Some(ahead.unwrap_or(here) - behind.unwrap_or(here)),
        };
        let [left, right, above, below] = self.neighbours(pixel);
        let (right, down) = (across(left, right)?, across(above, below)?);
        let normal = down.cross(&right).try_normalize(0.0)?;
        Some(normal * -normal.dot(&here.coords).signum())
    }

    /// Length of the ray (X/Z, Y/Z, 1) of a pixel.
    #[inline]
    pub(crate) fn ray_length(&self, pixel: usize) -> Option<f64> {
        let ray = self.camera.rays()[pixel]?;
        Some((1.0 + ray.norm_squared()).sqrt())
    }

    /// Area of the surface that a pixel sees, mm²: its solid angle over the cosine of incidence, times the range squared.
    pub(crate) fn pixel_area_mm2(&self, pixel: usize) -> Option<f64> {
        let (point, normal) = (self.point(pixel)?, self.normal(pixel)?);
        let at = Point3::from(point.coords / point.z);
        let (_, pixel_from_ray) = self.camera.project_with_jacobian(&at)?;
        let range_mm = point.coords.norm();
        // dΩ = dx dy / (1 + x² + y²)^(3/2), with dx dy = 1 / |∂(u, v)/∂(x, y)| of a pixel.
        let solid_angle = 1.0 / (pixel_from_ray.determinant().abs() * at.coords.norm().powi(3));
        let cos = -normal.dot(&point.coords) / range_mm;
        (cos > 0.0).then(|| range_mm * range_mm * solid_angle / cos)
    }

    /// The pixel among a pixel and its eight neighbours whose depth is closest to `z_mm`.
    pub(crate) fn closest(&self, pixel: usize, z_mm: f32) -> usize {
        let (width, height) = (self.image.width as usize, self.image.height as usize);
        let (column, row) = (pixel % width, pixel / width);
        let mut best = pixel;
        let off = |pixel: usize| (self.image.z_mm[pixel] - z_mm).abs();
        for row in row.saturating_sub(1)..(row + 2).min(height) {
            for column in column.saturating_sub(1)..(column + 2).min(width) {
                let other = row * width + column;
                if off(other) < off(best) {
                    best = other;
                }
            }
        }
        best
    }

    /// Cosine of the angle of incidence; 1 where there is no telling.
    #[inline]
    pub(crate) fn cos_incidence(&self, pixel: usize) -> f64 {
        match (self.point(pixel), self.normal(pixel)) {
            (Some(point), Some(normal)) => -normal.dot(&point.coords) / point.coords.norm(),
            _ => 1.0,
        }
    }
}

/// Signal of a diffuse surface relative to one seen square on at 1 m.
#[inline]
pub(crate) fn signal(cos_incidence: f64, range_mm: f64) -> f64 {
    cos_incidence * 1e6 / (range_mm * range_mm)
}
