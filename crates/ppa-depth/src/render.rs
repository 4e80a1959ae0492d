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
/// each other and themselves. An image of nothing is all 0: see [`DepthImage::require_visible`]. A body whose pose is not finite or
/// further than 1e9 mm is not seen.
pub fn render(camera: &Camera, bodies: &[PlacedBody]) -> DepthImage {
    draw(camera, &SeenBody::all(camera, bodies))
}

/// A body from the camera's place.
pub(crate) enum SeenBody<'a> {
    Mesh(SeenMesh<'a>),
    Surfels(SeenSurfels<'a>),
}

impl<'a> SeenBody<'a> {
    pub(crate) fn all(camera: &'a Camera, bodies: &[PlacedBody<'a>]) -> Vec<Self> {
        let seen = |placed: &PlacedBody<'a>| match placed.body {
            Body::Mesh(mesh) => Self::Mesh(SeenMesh::new(camera, mesh, &placed.camera_from_body)),
            Body::Surfels(surfels) => {
                Self::Surfels(SeenSurfels::new(surfels, &placed.camera_from_body))
            }
        };
        let somewhere = |placed: &&PlacedBody| placed.is_somewhere();
        bodies.iter().filter(somewhere).map(seen).collect()
    }
}

/// Depths at the centres of the pixels.
pub(crate) fn draw(camera: &Camera, bodies: &[SeenBody]) -> DepthImage {
    let buffer = DepthBuffer::empty(camera.rays().len());
    for body in bodies {
        match body {
            SeenBody::Mesh(mesh) => mesh.draw(&buffer),
            SeenBody::Surfels(surfels) => surfels.cast(camera.rays(), &buffer),
        }
    }
    DepthImage {
        width: camera.width(),
        height: camera.height(),
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
