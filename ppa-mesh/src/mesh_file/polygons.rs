//! Faces with any number of corners.

use super::error::Fault;

/// Cuts faces into fans of triangles around their first corner.
pub struct Polygons {
    vertices: usize,
    faces: usize,
    pub triangles: Vec<[u32; 3]>,
}

impl Polygons {
    /// For faces of a mesh with `vertices` vertices.
    pub fn between(vertices: usize) -> Self {
        Self {
            vertices,
            faces: 0,
            triangles: Vec::new(),
        }
    }

    /// Adds a face by its vertices, numbered from 0; `report` converts an index to the file's numbering.
    pub fn push(&mut self, corners: &[i64], report: impl Fn(i64) -> i64) -> Result<(), Fault> {
        if self.vertices == 0 {
            return Err(Fault::NoVertices);
        }
        let known = |&corner: &i64| (0..self.vertices as i64).contains(&corner);
        if let Some(&corner) = corners.iter().find(|corner| !known(corner)) {
            return Err(Fault::Index {
                face: self.faces,
                found: report(corner).to_string(),
                vertices: self.vertices,
            });
        }
        self.faces += 1;
        if let [first, rest @ ..] = corners {
            let fan = rest.windows(2).map(|pair| [*first, pair[0], pair[1]]);
            self.triangles.extend(fan.map(|t| t.map(|v| v as u32)));
        }
        Ok(())
    }
}
