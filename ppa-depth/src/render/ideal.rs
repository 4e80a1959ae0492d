//! From placed bodies to a depth image.

use nalgebra::{Isometry3, Matrix3, Point3, Vector2, Vector3};
use rayon::prelude::*;

use crate::camera::projection::Camera;
use crate::image::DepthImage;
use crate::render::body::{Body, PlacedBody};
use crate::render::depth_buffer::DepthBuffer;
use crate::render::nearest::Ray;
use crate::render::raster::SeenMesh;
use crate::render::surfel_body::SurfelBody;

/// Depth image of the bodies as the camera sees them: per pixel the z coordinate (mm) of the nearest surface on the ray
/// through the pixel's centre, or 0.
///
/// Rays follow the exact inverse of the lens distortion ([`Camera::rays`]); pixels without a ray stay 0. Bodies occlude each other and themselves,
/// and walls are surfaces like any other. An image of nothing is all 0: see [`DepthImage::require_visible`]. A body whose pose is not finite or
/// further than 1e9 mm is not seen.
pub fn render(camera: &Camera, bodies: &[PlacedBody]) -> DepthImage {
    draw(camera, &SeenBody::all(camera, bodies))
}

/// A body as seen from the camera.
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

    fn draw_open(&self, camera: &Camera, buffer: &DepthBuffer) {
        match self {
            Self::Mesh(mesh) => mesh.draw(buffer),
            Self::Surfels(surfels) => surfels.cast(camera.rays(), buffer),
        }
    }

    fn draw_walls(&self, buffer: &DepthBuffer) {
        if let Self::Mesh(mesh) = self {
            mesh.draw_walls(buffer);
        }
    }

    pub(crate) fn has_walls(&self) -> bool {
        matches!(self, Self::Mesh(seen) if !seen.mesh.walls.is_empty())
    }
}

/// Depths at the centres of the pixels.
pub(crate) fn draw(camera: &Camera, bodies: &[SeenBody]) -> DepthImage {
    let buffer = DepthBuffer::empty(camera.rays().len());
    for body in bodies {
        body.draw_open(camera, &buffer);
        body.draw_walls(&buffer);
    }
    image_of(camera, buffer)
}

/// [`draw`] without walls.
pub(crate) fn draw_open(camera: &Camera, bodies: &[SeenBody]) -> DepthImage {
    let buffer = DepthBuffer::empty(camera.rays().len());
    for body in bodies {
        body.draw_open(camera, &buffer);
    }
    image_of(camera, buffer)
}

/// [`draw`] of walls alone; `None` if there are none.
pub(crate) fn draw_walls(camera: &Camera, bodies: &[SeenBody]) -> Option<DepthImage> {
    if !bodies.iter().any(SeenBody::has_walls) {
        return None;
    }
    let buffer = DepthBuffer::empty(camera.rays().len());
    for body in bodies {
        body.draw_walls(&buffer);
    }
    Some(image_of(camera, buffer))
}

fn image_of(camera: &Camera, buffer: DepthBuffer) -> DepthImage {
    DepthImage {
        width: camera.width(),
        height: camera.height(),
        z_mm: buffer.into_depths(),
    }
}

/// Discs with the camera transformed into their frame, so that one index serves any pose.
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
