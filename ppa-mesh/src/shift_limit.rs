//! Largest displacement of a skin before it folds or meets itself.

use nalgebra::{Point3, Vector3};

use crate::mesh::Mesh;
use crate::neighbours::Neighbours;
use crate::self_crossings::self_crossings;

/// The skin around a vertex counts as folded when its area, seen along its original normal, falls
/// below this fraction of what it was; inside out is below 0.
const LEAST_AREA_RATIO: f64 = 0.2;
/// Shifts of vertices at folds and crossings are reduced by this factor per round.
const REDUCTION: f64 = 0.9;
/// Enough rounds to reduce a shift to less than a hundredth, for folds and again for crossings.
const ROUNDS: usize = 45;
/// Rounds in which crossings between neighbours are repaired by sideways steps only.
const EVEN_ROUNDS: usize = 20;
/// Change of the shift per length of skin next to a reduced place.
const SLOPE: f64 = 0.2;

/// New positions of the vertices of a mesh, moved along unit directions by shifts (mm) that are reduced
/// such that the mesh neither folds nor passes through itself.
///
/// Inwards, it folds where it is curved outwards more tightly than the shift (the tips of toes) and
/// meets itself where it is thinner than twice the shift; outwards, in creases and between toes. There
/// the shifts are reduced, with a smooth transition. Triangles that turn over because their corners move
/// in slightly different directions are spread out perpendicular to them instead.
pub fn without_folds(
    mesh: &Mesh,
    neighbours: &Neighbours,
    directions: &[Vector3<f64>],
    mut shifts_mm: Vec<f64>,
) -> Vec<Point3<f64>> {
    let place = |v: u32| mesh.vertices[v as usize].cast::<f64>();
    let before = vertex_areas(mesh, place);
    let mut aside = vec![Vector3::zeros(); before.len()];
    let (mut fold_rounds, mut crossing_rounds) = (0, 0);
    loop {
        let moved = |v: u32| {
            let at = v as usize;
            place(v) + directions[at] * shifts_mm[at] + aside[at]
        };
        let places: Vec<Point3<f64>> = (0..before.len() as u32).map(moved).collect();
        let after = vertex_areas(mesh, |v| places[v as usize]);
        let folded = |v: &u32| {
            let before = before[*v as usize];
            after[*v as usize].dot(&before) < LEAST_AREA_RATIO * before.norm_squared()
        };
        let mut reduced: Vec<u32> = (0..before.len() as u32).filter(folded).collect();
        if reduced.is_empty() || fold_rounds == ROUNDS {
            let (near, far) = crossing_vertices(mesh, neighbours, &places);
            if near.is_empty() && far.is_empty() || crossing_rounds == ROUNDS {
                return places;
            }
            crossing_rounds += 1;
            reduced = far;
            if crossing_rounds > EVEN_ROUNDS {
                reduced.extend(&near);
            }
            for (vertex, step) in even_steps(neighbours, directions, &places, near) {
                aside[vertex as usize] += step;
            }
        } else {
            fold_rounds += 1;
        }
        for &vertex in &reduced {
            shifts_mm[vertex as usize] *= REDUCTION;
        }
        relax(neighbours, place, &mut shifts_mm, reduced);
    }
}

/// Vertices of triangles that cross a neighbour, and of those that cross another part of the mesh.
fn crossing_vertices(
    mesh: &Mesh,
    neighbours: &Neighbours,
    places: &[Point3<f64>],
) -> (Vec<u32>, Vec<u32>) {
    let (mut near, mut far) = (Vec::new(), Vec::new());
    for pair in self_crossings(places, &mesh.triangles) {
        let [one, other] = pair.map(|triangle| mesh.triangles[triangle as usize]);
        let touches = |v: &u32| {
            let around = neighbours.of_vertex(*v as usize);
            other.contains(v) || other.iter().any(|o| around.contains(o))
        };
        let list = if one.iter().any(touches) {
            &mut near
        } else {
            &mut far
        };
        list.extend(one.iter().chain(&other));
    }
    for list in [&mut near, &mut far] {
        list.sort_unstable();
        list.dedup();
    }
    (near, far)
}

/// Sideways steps that move some vertices and those around them between their neighbours.
///
/// Vertices at the mean of their neighbours, with those farther out fixed, form no folds (Tutte 1963,
/// doi:10.1112/plms/s3-13.1.743).
fn even_steps(
    neighbours: &Neighbours,
    directions: &[Vector3<f64>],
    places: &[Point3<f64>],
    mut vertices: Vec<u32>,
) -> Vec<(u32, Vector3<f64>)> {
    let around = |v: u32| neighbours.of_vertex(v as usize);
    let rings: Vec<u32> = vertices.iter().flat_map(|&v| around(v)).copied().collect();
    vertices.extend(rings);
    vertices.sort_unstable();
    vertices.dedup();
    let step = |vertex: u32| {
        let (here, direction) = (places[vertex as usize], directions[vertex as usize]);
        let steps = around(vertex).iter().map(|&v| places[v as usize] - here);
        let step = steps.sum::<Vector3<f64>>() / around(vertex).len() as f64;
        (vertex, step - direction * direction.dot(&step))
    };
    vertices.into_iter().map(step).collect()
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

/// Twice the vector area of the triangles around each vertex, which depends only on their outline:
/// single slivers, whose normals are unreliable, do not affect it.
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
