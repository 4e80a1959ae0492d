//! The surface in a depth image: points and angles of incidence.

use nalgebra::{Point3, Vector3};

use crate::camera::projection::Camera;
use crate::image::DepthImage;
use crate::render::sampled::EDGE_MM;

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

    /// The next pixel `step` indices away, if it is on the same surface, however steep that is. There are `ahead` pixels in that
    /// direction and `behind` in the opposite one.
    ///
    /// 1/z of a plane is linear in the image of a pinhole, so its second difference over three pixels in a row vanishes, whereas a step
    /// of h gives h / z². The third pixel may be before or after the two.
    #[inline(always)]
    fn next(&self, pixel: usize, step: isize, ahead: usize, behind: usize) -> Option<Point3<f64>> {
        let z_mm = &self.image.z_mm;
        if ahead == 0 {
            return None;
        }
        let at = |steps: isize| z_mm[pixel.wrapping_add_signed(steps * step)];
        let (here, next) = (at(0), at(1));
        let point = || self.point(pixel.wrapping_add_signed(step));
        if (next - here).abs() <= EDGE_MM {
            return point();
        }
        let straight = |third: f32, middle: f32, end: f32| {
            let [third, middle, end] = [third, middle, end].map(f64::from);
            let bend = 1.0 / third + 1.0 / end - 2.0 / middle;
            third > 0.0 && end > 0.0 && (bend * middle * middle).abs() <= f64::from(EDGE_MM)
        };
        let continued = behind > 0 && straight(at(-1), here, next)
            || next > 0.0 && ahead > 1 && straight(at(2), next, here);
        if continued { point() } else { None }
    }

    /// Points of the neighbours left, right, above and below that lie on the same surface.
    #[inline(always)]
    fn neighbours(&self, pixel: usize) -> [Option<Point3<f64>>; 4] {
        let (width, height) = (self.image.width, self.image.height);
        let (column, row) = (pixel as u32 % width, pixel as u32 / width);
        let [left, above] = [column, row].map(|pixels| pixels as usize);
        let [right, below] = [width - 1 - column, height - 1 - row].map(|pixels| pixels as usize);
        let width = width as isize;
        [
            self.next(pixel, -1, left, right),
            self.next(pixel, 1, right, left),
            self.next(pixel, -width, above, below),
            self.next(pixel, width, below, above),
        ]
    }

    /// Unit normal towards the camera, from the neighbours on the same surface; `None` if there are too few.
    #[inline]
    pub(crate) fn normal(&self, pixel: usize) -> Option<Vector3<f64>> {
        let here = self.point(pixel)?;
        let normal = self.across(pixel, here)?.try_normalize(0.0)?;
        Some(normal * -normal.dot(&here.coords).signum())
    }

    /// A vector normal to the surface at the point that a pixel sees, of either sign and any length.
    #[inline(always)]
    fn across(&self, pixel: usize, here: Point3<f64>) -> Option<Vector3<f64>> {
        let across = |behind: Option<Point3<f64>>, ahead: Option<Point3<f64>>| match (behind, ahead)
        {
            (None, None) => None,
            (behind, ahead) => Some(ahead.unwrap_or(here) - behind.unwrap_or(here)),
        };
        let [left, right, above, below] = self.neighbours(pixel);
        let (right, down) = (across(left, right)?, across(above, below)?);
        Some(down.cross(&right))
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

    /// Cosine of the angle of incidence; 1 if unknown.
    #[inline]
    pub(crate) fn cos_incidence(&self, pixel: usize) -> f64 {
        let Some(point) = self.point(pixel) else {
            return 1.0;
        };
        let Some(across) = self.across(pixel, point) else {
            return 1.0;
        };
        // One root for both lengths.
        let lengths_sq = across.norm_squared() * point.coords.norm_squared();
        if lengths_sq > 0.0 {
            across.dot(&point.coords).abs() / lengths_sq.sqrt()
        } else {
            1.0
        }
    }
}

/// Signal of a diffuse surface relative to one at normal incidence at 1 m.
#[inline]
pub(crate) fn signal(cos_incidence: f64, range_mm: f64) -> f64 {
    cos_incidence * 1e6 / (range_mm * range_mm)
}
