//! From placed bodies to a depth image.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use rayon::prelude::*;

use crate::body::{Body, PlacedBody};
use crate::camera::Camera;
use crate::image::DepthImage;
use crate::nearest::Ray;

/// A body with the camera taken into its frame, so that its index serves any pose.
struct SeenBody<'a> {
    body: &'a Body,
    eye: Point3<f64>,
    body_from_camera: Matrix3<f64>,
}

impl<'a> SeenBody<'a> {
    fn new(placed: &PlacedBody<'a>) -> Self {
        let body_from_camera: Isometry3<f64> = placed.camera_from_body.inverse();
        Self {
            body: placed.body,
            eye: body_from_camera * Point3::origin(),
            body_from_camera: body_from_camera.rotation.to_rotation_matrix().into_inner(),
        }
    }
}

/// Depth image of the bodies as the camera sees them: per pixel the z coordinate (mm) of the nearest surface on the ray
/// through the pixel's centre, or 0.
///
/// Rays follow the exact inverse of the lens distortion ([`Camera::rays`]); pixels without a ray stay 0. Bodies occlude
/// each other and themselves. An image of nothing is all 0: see [`DepthImage::require_visible`].
pub fn render(camera: &Camera, bodies: &[PlacedBody]) -> DepthImage {
    let seen: Vec<SeenBody> = bodies.iter().map(SeenBody::new).collect();
    let mut image = DepthImage::empty(camera.width(), camera.height());
    let width = camera.width() as usize;
    let rows = image
        .z_mm
        .par_chunks_mut(width)
        .zip(camera.rays().par_chunks(width));
    rows.for_each(|(row, rays)| {
        for (z_mm, slopes) in row.iter_mut().zip(rays) {
            let Some(slopes) = slopes else { continue };
            // A direction of camera z = 1 makes the ray parameter the z-depth.
            let direction = Vector3::new(slopes.x, slopes.y, 1.0);
            let nearest = seen.iter().fold(f64::INFINITY, |limit, seen| {
                let ray = Ray {
                    origin: seen.eye,
                    direction: seen.body_from_camera * direction,
                };
                seen.body.nearest(&ray, limit).unwrap_or(limit)
            });
            if nearest.is_finite() {
                *z_mm = nearest as f32;
            }
        }
    });
    image
}
