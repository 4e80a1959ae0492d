//! Normals that vary so slowly over a skin that moving its vertices along them does not fold it.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::mesh::Mesh;
use crate::neighbours::Neighbours;

/// Rounds of averaging over neighbours.
const ROUNDS: usize = 24;
/// Edges shorter than this weigh no more than it, mm.
const SHORTEST_MM: f32 = 1e-4;

/// Normals averaged with those of near neighbours, weighted by proximity: vertices of a sliver get
/// nearly the same normal, so that it does not turn over when they move.
pub fn smooth_normals(mesh: &Mesh, neighbours: &Neighbours) -> Vec<Vector3<f64>> {
    let mut normals: Vec<Vector3<f64>> = mesh.normals.iter().map(|n| n.cast()).collect();
    for _ in 0..ROUNDS {
        normals = (0..normals.len())
            .into_par_iter()
            .map(|vertex| blended(mesh, neighbours, &normals, vertex))
            .collect();
    }
    normals
}

/// The direction of a vertex, half its own and half that of its neighbours.
fn blended(
    mesh: &Mesh,
    neighbours: &Neighbours,
    directions: &[Vector3<f64>],
    vertex: usize,
) -> Vector3<f64> {
    let here = mesh.vertices[vertex];
    let (mut sum, mut weights) = (Vector3::zeros(), 0.0);
    for &other in neighbours.of_vertex(vertex) {
        let length = (mesh.vertices[other as usize] - here).norm();
        let weight = 1.0 / f64::from(length.max(SHORTEST_MM));
        sum += directions[other as usize] * weight;
        weights += weight;
    }
    let blend = sum + directions[vertex] * weights;
    blend.try_normalize(1e-9).unwrap_or(directions[vertex])
}
