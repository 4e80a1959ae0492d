//! Test for a camera inside a body.

use nalgebra::{Point3, Vector2};
use rayon::prelude::*;

use crate::render::body::{Body, PlacedBody};
use crate::render::body_error::BodyError;
use crate::render::mesh_body::MeshBody;
use crate::render::triangle::Triangle;

impl PlacedBody<'_> {
    /// Returns an error if the camera is inside a closed mesh: it would see the mesh from within. Walls close a mesh; open meshes and
    /// discs have no inside.
    ///
    /// # Errors
    /// [`BodyError::CameraInside`]; [`BodyError::Pose`] for a pose that is not finite.
    pub fn require_camera_outside(&self) -> Result<(), BodyError> {
        if !self.is_somewhere() {
            let moved = self.camera_from_body.translation.vector;
            return Err(BodyError::Pose(moved.into()));
        }
        let eye = self.camera_from_body.inverse() * Point3::origin();
        match self.body {
            Body::Mesh(mesh) if mesh.encloses(&eye) => Err(BodyError::CameraInside {
                eye: eye.coords.into(),
            }),
            _ => Ok(()),
        }
    }
}

impl MeshBody {
    /// Whether every ray from a point, along six directions, meets the mesh an odd number of times. The orientation of the
    /// triangles does not matter; a surface that one of the rays leaves through a hole has no inside.
    fn encloses(&self, point: &Point3<f64>) -> bool {
        let [low, high] = &self.bounds;
        let within =
            |axis: usize| f64::from(low[axis]) < point[axis] && point[axis] < f64::from(high[axis]);
        if !(0..3).all(within) {
            return false;
        }
        // One bit per direction: whether it was met an odd number of times.
        let met = |corners: &[u32; 3]| {
            let corners = corners.map(|i| self.vertices[i as usize].cast::<f64>() - point);
            let (ahead, behind) = (
                Triangle::new(corners.map(Point3::from)),
                Triangle::new(corners.map(|corner| Point3::from(-corner))),
            );
            let directions = DIRECTIONS.iter().enumerate();
            directions.fold(0_u8, |bits, (i, &[x, y])| {
                let ray = Vector2::new(x, y);
                let hits = |triangle: &Triangle| u8::from(triangle.depth(&ray).is_some());
                bits | hits(&ahead) << (2 * i) | hits(&behind) << (2 * i + 1)
            })
        };
        let odd = self
            .triangles
            .par_iter()
            .chain(&self.walls)
            .map(met)
            .reduce(|| 0, |a, b| a ^ b);
        odd == (1 << (2 * DIRECTIONS.len())) - 1
    }
}

/// X/Z and Y/Z of the rays; no mesh on a lattice has edges along them.
const DIRECTIONS: [[f64; 2]; 3] = [
    [0.123_456_7, -0.076_543_2],
    [-0.654_321_8, 0.912_345_1],
    [1.234_517_9, 0.378_912_3],
];
