//! Bodies in front of a camera.

use nalgebra::Isometry3;

use crate::render::mesh_body::MeshBody;
use crate::render::surfel_body::SurfelBody;

/// A surface in its own frame, placed in many poses.
#[derive(Debug, Clone)]
pub enum Body {
    /// Triangles.
    Mesh(MeshBody),
    /// Oriented discs.
    Surfels(SurfelBody),
}

/// A body and its pose.
#[derive(Debug, Clone, Copy)]
pub struct PlacedBody<'a> {
    /// The surface.
    pub body: &'a Body,
    /// Rigid motion from the body's frame to the camera's, mm.
    pub camera_from_body: Isometry3<f64>,
}

/// Largest distance that a body may be moved, mm.
const FARTHEST_MM: f64 = 1e9;

impl PlacedBody<'_> {
    /// Whether the pose is finite and within [`FARTHEST_MM`].
    pub(crate) fn is_somewhere(&self) -> bool {
        let Isometry3 {
            rotation,
            translation,
        } = self.camera_from_body;
        rotation.coords.iter().all(|x| x.is_finite())
            && translation.vector.iter().all(|mm| mm.abs() <= FARTHEST_MM)
    }
}

impl From<MeshBody> for Body {
    fn from(mesh: MeshBody) -> Self {
        Self::Mesh(mesh)
    }
}

impl From<SurfelBody> for Body {
    fn from(surfels: SurfelBody) -> Self {
        Self::Surfels(surfels)
    }
}
