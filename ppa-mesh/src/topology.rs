//! Counts that show whether a mesh is one closed surface: boundary edges, components, Euler characteristic.

use crate::mesh::Mesh;

/// Connectivity of the triangles of a mesh. Vertices without a triangle do not count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Topology {
    /// Vertices used by a triangle.
    pub vertices: usize,
    /// Distinct edges.
    pub edges: usize,
    /// Edges that belong to one triangle only; 0 for a closed surface.
    pub boundary_edges: usize,
    /// Edges that belong to more than two triangles; 0 for a manifold.
    pub non_manifold_edges: usize,
    /// Connected pieces, by shared vertices.
    pub components: usize,
    /// Vertices − edges + triangles: 2 for each closed piece without handles.
    pub euler: i64,
}

impl Mesh {
    /// All counts in one pass.
    pub fn topology(&self) -> Topology {
        let labels = self.vertex_components();
        let mut used = vec![false; self.vertices.len()];
        let mut edges = Vec::with_capacity(3 * self.triangles.len());
        for &[a, b, c] in &self.triangles {
            for (p, q) in [(a, b), (b, c), (c, a)] {
                used[p as usize] = true;
                edges.push(u64::from(p.min(q)) << 32 | u64::from(p.max(q)));
            }
        }
        edges.sort_unstable();
        let runs = edges.chunk_by(|a, b| a == b).map(<[u64]>::len);
        let (mut count, mut boundary_edges, mut non_manifold_edges) = (0, 0, 0);
        for run in runs {
            count += 1;
            boundary_edges += usize::from(run == 1);
            non_manifold_edges += usize::from(run > 2);
        }
        let vertices = used.iter().filter(|u| **u).count();
        let roots = (0..used.len()).filter(|&v| used[v] && labels[v] as usize == v);
        Topology {
            vertices,
            edges: count,
            boundary_edges,
            non_manifold_edges,
            components: roots.count(),
            euler: vertices as i64 - count as i64 + self.triangles.len() as i64,
        }
    }

    /// Edges that belong to one triangle only.
    pub fn boundary_edges(&self) -> usize {
        self.topology().boundary_edges
    }

    /// Vertices − edges + triangles.
    pub fn euler(&self) -> i64 {
        self.topology().euler
    }

    /// Number of connected pieces.
    pub fn components(&self) -> usize {
        self.topology().components
    }

    /// For each vertex the smallest vertex index of its connected piece.
    pub fn vertex_components(&self) -> Vec<u32> {
        let mut parent: Vec<u32> = (0..self.vertices.len() as u32).collect();
        for &[a, b, c] in &self.triangles {
            join(&mut parent, a, b);
            join(&mut parent, b, c);
        }
        for v in 0..parent.len() {
            // Parents have smaller indices, so they already point to their root.
            parent[v] = parent[parent[v] as usize];
        }
        parent
    }
}

/// Joins the sets of `a` and `b` under the smaller root (union-find with path halving).
pub(crate) fn join(parent: &mut [u32], a: u32, b: u32) {
    let (a, b) = (root(parent, a), root(parent, b));
    parent[a.max(b) as usize] = a.min(b);
}

pub(crate) fn root(parent: &mut [u32], mut at: u32) -> u32 {
    while parent[at as usize] != at {
        let up = parent[parent[at as usize] as usize];
        parent[at as usize] = up;
        at = up;
    }
    at
}
