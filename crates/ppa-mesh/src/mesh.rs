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

    /// The vertices as a cloud.
    pub fn to_cloud(&self) -> PointCloud {
        PointCloud {
            points: self.vertices.clone(),
            normals: self.normals.clone(),
        }
    }
}
