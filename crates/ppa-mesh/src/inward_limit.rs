//! How far a skin can shrink before it turns inside out.

use nalgebra::{Point3, Vector3};

use crate::mesh::Mesh;
use crate::neighbours::Neighbours;

/// The skin around a vertex counts as folded when its area, seen along its original normal, falls
/// below this fraction of what it was; inside out is below 0.
const LEAST_AREA_RATIO: f64 = 0.2;
/// Shifts at folded vertices are reduced by this factor per round.
const REDUCTION: f64 = 0.9;
/// Enough rounds to reduce a shift to less than a hundredth.
const ROUNDS: usize = 45;
/// Change of the shift per length of skin next to a reduced place.
const SLOPE: f64 = 0.2;

/// Shifts along `normals`, mm, made smaller where they would fold the mesh and smoothly around.
pub fn without_folds(
    mesh: &Mesh,
    neighbours: &Neighbours,
    normals: &[Vector3<f64>],
    mut shifts_mm: Vec<f64>,
) -> Vec<f64> {
    let place = |v: u32| mesh.vertices[v as usize].cast::<f64>();
    let before = vertex_areas(mesh, place);
    for _ in 0..ROUNDS {
        let moved = |v: u32| place(v) + normals[v as usize] * shifts_mm[v as usize];
        let after = vertex_areas(mesh, moved);
        let reduced: Vec<u32> = (0..before.len())
            .filter(|&v| after[v].dot(&before[v]) < LEAST_AREA_RATIO * before[v].norm_squared())
            .map(|v| v as u32)
            .collect();
        if reduced.is_empty() {
            break;
        }
        for &vertex in &reduced {
            shifts_mm[vertex as usize] *= REDUCTION;
        }
        relax(neighbours, place, &mut shifts_mm, reduced);
    }
    shifts_mm
}

/// Lets no shift exceed that of a neighbour by more than [`SLOPE`] allows, starting from `changed`.
fn relax(
    neighbours: &Neighbours,
    place: impl Fn(u32) -> Point3<f64>,
    shifts_mm: &mut [f64],
    mut changed: Vec<u32>,
) {
    while !changed.is_empty() {
        let mut next = Vec::new();
        for vertex in changed {
            for &other in neighbours.of_vertex(vertex as usize) {
                let rise = SLOPE * (place(other) - place(vertex)).norm();
                let most = shifts_mm[vertex as usize].abs() + rise;
                let shift = &mut shifts_mm[other as usize];
                if shift.abs() > most {
                    *shift = most.copysign(*shift);
                    next.push(other);
                }
            }
        }
        next.sort_unstable();
        next.dedup();
        changed = next;
    }
}

/// Twice the vector area of the triangles around each vertex, which depends on the outline of
/// these alone: single slivers, whose normals say nothing, do not disturb it.
fn vertex_areas(mesh: &Mesh, place: impl Fn(u32) -> Point3<f64>) -> Vec<Vector3<f64>> {
    let mut areas = vec![Vector3::zeros(); mesh.vertices.len()];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(&place);
        let area = (b - a).cross(&(c - a));
        for &vertex in triangle {
            areas[vertex as usize] += area;
        }
    }
    areas
}
