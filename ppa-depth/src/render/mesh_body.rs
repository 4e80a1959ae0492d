//! Triangle meshes.

use nalgebra::Point3;

use crate::render::body_error::{BodyError, check_count, check_points};

/// A triangle mesh in its own frame, mm. Both sides of a triangle are seen, so the orientation does not matter.
#[derive(Debug, Clone)]
pub struct MeshBody {
    pub(crate) vertices: Vec<Point3<f32>>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Further triangles, where the mesh was cut off.
    pub(crate) walls: Vec<[u32; 3]>,
    /// Largest coordinate.
    pub(crate) reach_mm: f32,
    /// Lower and upper corner of the box around all vertices.
    pub(crate) bounds: [Point3<f32>; 2],
}

impl MeshBody {
    /// Checks and copies the mesh.
    ///
    /// # Errors
    /// [`BodyError`] for no triangle, a coordinate that is not finite, or a triangle that names a missing vertex.
    pub fn new(vertices: &[Point3<f32>], triangles: &[[u32; 3]]) -> Result<Self, BodyError> {
        check_count(triangles.len(), "triangle")?;
        let reach_mm = check_points(vertices)?;
        check_corners(triangles, vertices.len())?;
        let around = |[low, high]: [Point3<f32>; 2], p: &Point3<f32>| [low.inf(p), high.sup(p)];
        let nothing = [f32::INFINITY, f32::NEG_INFINITY].map(|x| Point3::new(x, x, x));
        Ok(Self {
            bounds: vertices.iter().fold(nothing, around),
            vertices: vertices.to_vec(),
            triangles: triangles.to_vec(),
            walls: Vec::new(),
            reach_mm,
        })
    }

    /// The mesh with walls: triangles on its vertices that close it where its source was cut off, such as a limb by the
    /// field of view of its scan. They hide what is behind them; [`render`](crate::render) draws them like any other surface,
    /// [`render_before`](crate::render_before) separates them from it.
    ///
    /// # Errors
    /// [`BodyError::Vertex`] for a wall that names a missing vertex.
    pub fn with_walls(self, walls: &[[u32; 3]]) -> Result<Self, BodyError> {
        check_corners(walls, self.vertices.len())?;
        Ok(Self {
            walls: walls.to_vec(),
            ..self
        })
    }
}

/// Checks that triangles refer to existing vertices.
fn check_corners(triangles: &[[u32; 3]], vertices: usize) -> Result<(), BodyError> {
    let missing = |corner: &u32| *corner as usize >= vertices;
    let corners = triangles.as_flattened();
    // The largest index is found in vector code; which triangle has it matters only to the error.
    if !corners.iter().max().is_some_and(missing) {
        return Ok(());
    }
    let first = corners.iter().position(missing).unwrap_or_default();
    Err(BodyError::Vertex {
        triangle: first / 3,
        vertex: corners[first],
        vertices,
    })
}
