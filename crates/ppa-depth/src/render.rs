//! From placed bodies to a depth image.

use nalgebra::{Isometry3, Matrix3, Point3, Vector2, Vector3};
use rayon::prelude::*;

use crate::body::{Body, PlacedBody};
use crate::camera::Camera;
use crate::depth_buffer::DepthBuffer;
use crate::image::DepthImage;
use crate::nearest::Ray;
use crate::raster::SeenMesh;
use crate::surfel_body::SurfelBody;

/// Depth image of the bodies as the camera sees them: per pixel the z coordinate (mm) of the nearest surface on the ray
/// through the pixel's centre, or 0.
///
/// Rays follow the exact inverse of the lens distortion ([`Camera::rays`]); pixels without a ray stay 0. Bodies occlude
/// each other and themselves. An image of nothing is all 0: see [`DepthImage::require_visible`].
pub fn render(camera: &Camera, bodies: &[PlacedBody]) -> DepthImage {
    let (width, height) = (camera.width(), camera.height());
    let buffer = DepthBuffer::empty(camera.rays().len());
    for PlacedBody {
        body,
        camera_from_body,
    } in bodies
    {
        match body {
            Body::Mesh(mesh) => SeenMesh::new(camera, mesh, camera_from_body).draw(&buffer),
            Body::Surfels(surfels) => {
                SeenSurfels::new(surfels, camera_from_body).cast(camera.rays(), &buffer);
            }
        }
    }
    DepthImage {
        width,
        height,
        z_mm: buffer.into_depths(),
    }
}

/// Discs with the camera taken into their frame, so that one index serves any pose.
pub(crate) struct SeenSurfels<'a> {
    surfels: &'a SurfelBody,
    eye: Point3<f64>,
    body_from_camera: Matrix3<f64>,
}

impl<'a> SeenSurfels<'a> {
    pub(crate) fn new(surfels: &'a SurfelBody, camera_from_body: &Isometry3<f64>) -> Self {
        let body_from_camera = camera_from_body.inverse();
        Self {
            surfels,
            eye: body_from_camera * Point3::origin(),
            body_from_camera: body_from_camera.rotation.to_rotation_matrix().into_inner(),
        }
    }

    /// Offers the nearest depth along each ray; rays and pixels correspond.
    pub(crate) fn cast(&self, rays: &[Option<Vector2<f64>>], buffer: &DepthBuffer) {
        rays.par_iter().enumerate().for_each(|(pixel, slopes)| {
            let Some(slopes) = slopes else { return };
            // A direction of camera z = 1 makes the ray parameter the z-depth.
            let ray = Ray {
                origin: self.eye,
                direction: self.body_from_camera * Vector3::new(slopes.x, slopes.y, 1.0),
            };
            let limit = f64::from(buffer.nearest(pixel));
            if let Some(z_mm) = self.surfels.nearest(&ray, limit) {
                buffer.offer(pixel, z_mm as f32);
            }
        });
    }
}
