//! Triangle meshes and point clouds with outward normals.

use nalgebra::{Isometry3, Point3, Vector3};

/// A triangle mesh with shared vertices; counter-clockwise triangles seen from outside.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions, mm.
    pub vertices: Vec<Point3<f32>>,
    /// Unit outward normal of each vertex.
    pub normals: Vec<Vector3<f32>>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// Points with unit outward normals.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PointCloud {
    /// Positions, mm.
    pub points: Vec<Point3<f32>>,
    /// Unit normals, one per point, or empty when unknown.
    pub normals: Vec<Vector3<f32>>,
}

impl Mesh {
    /// The mesh moved rigidly into another frame.
    pub fn transformed(&self, target_from_source: &Isometry3<f64>) -> Self {
        let motion = target_from_source.cast::<f32>();
        Self {
            vertices: self.vertices.iter().map(|v| motion * v).collect(),
            normals: self.normals.iter().map(|n| motion * n).collect(),
            triangles: self.triangles.clone(),
        }
    }

    /// Unit normals from the triangles around each vertex, weighted by their area; zero for a vertex
    /// without triangles.
    pub fn geometric_normals(&self) -> Vec<Vector3<f32>> {
        let mut sums = vec![Vector3::<f64>::zeros(); self.vertices.len()];
        for triangle in &self.triangles {
            let [a, b, c] = self.corners(triangle);
            let area = (b - a).cross(&(c - a));
            for &id in triangle {
                sums[id as usize] += area;
            }
        }
        sums.iter()
            .map(|n| n.try_normalize(0.0).unwrap_or_default().cast())
            .collect()
    }

    /// Total area of the triangles, mm².
    pub fn area_mm2(&self) -> f64 {
        self.triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = self.corners(triangle);
                0.5 * (b - a).cross(&(c - a)).norm()
            })
            .sum()
    }

    /// Signed volume enclosed, mm³; positive when triangles are counter-clockwise seen from outside.
    ///
    /// Only meaningful without boundary edges: an open mesh is closed by a cone from its first vertex.
    pub fn volume_mm3(&self) -> f64 {
        let origin = self
            .vertices
            .first()
            .copied()
            .unwrap_or_default()
            .cast::<f64>();
        self.triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = self.corners(triangle).map(|p| p - origin);
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum()
    }

    /// Triangles whose vertices are all kept, with the vertices renumbered in order.
    pub(crate) fn restricted(&self, keep: impl Fn(u32) -> bool) -> Self {
        let mut part = Self::default();
        let mut number = vec![u32::MAX; self.vertices.len()];
        for vertex in (0..self.vertices.len() as u32).filter(|&v| keep(v)) {
            number[vertex as usize] = part.vertices.len() as u32;
            part.vertices.push(self.vertices[vertex as usize]);
            part.normals.push(self.normals[vertex as usize]);
        }
        let triangles = self.triangles.iter().map(|t| t.map(|v| number[v as usize]));
        part.triangles = triangles.filter(|t| !t.contains(&u32::MAX)).collect();
        part
    }

    pub(crate) fn corners(&self, triangle: &[u32; 3]) -> [Point3<f64>; 3] {
        triangle.map(|id| self.vertices[id as usize].cast())
    }
}
