//! Neighbours of the vertices of a mesh.

use crate::mesh::Mesh;

/// Vertices joined by an edge, for every vertex.
pub struct Neighbours {
    start: Vec<usize>,
    list: Vec<u32>,
}

impl Neighbours {
    pub fn of(mesh: &Mesh) -> Self {
        let mut edges: Vec<(u32, u32)> = mesh
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
            .flat_map(|(a, b)| [(a, b), (b, a)])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let start = (0..=mesh.vertices.len() as u32)
            .map(|vertex| edges.partition_point(|&(from, _)| from < vertex))
            .collect();
        Self {
            start,
            list: edges.into_iter().map(|(_, to)| to).collect(),
        }
    }

    pub fn of_vertex(&self, vertex: usize) -> &[u32] {
        &self.list[self.start[vertex]..self.start[vertex + 1]]
    }
}
