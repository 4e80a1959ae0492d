//! Closed surfaces whose distance to the smooth shape is known.

use nalgebra::{Point3, Vector3};
use std::collections::HashMap;

/// Unit icosphere after `levels` subdivisions: 20 · 4^levels triangles.
pub fn icosphere(levels: u32) -> (Vec<Point3<f32>>, Vec<[u32; 3]>) {
    let phi = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut vertices: Vec<Vector3<f64>> = Vec::new();
    for (a, b) in [(1.0, phi), (1.0, -phi), (-1.0, phi), (-1.0, -phi)] {
        vertices.extend([
            Vector3::new(a, b, 0.0),
            Vector3::new(0.0, a, b),
            Vector3::new(b, 0.0, a),
        ]);
    }
    // The faces are the triples of corners that are one edge length (2) apart.
    let near = |i: usize, j: usize| ((vertices[i] - vertices[j]).norm() - 2.0).abs() < 1e-9;
    let mut triangles = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            triangles.extend(
                (j + 1..12)
                    .filter(|&k| near(i, j) && near(j, k) && near(i, k))
                    .map(|k| [i, j, k]),
            );
        }
    }
    vertices
        .iter_mut()
        .for_each(|vertex| *vertex = vertex.normalize());
    for _ in 0..levels {
        let mut midpoints = HashMap::new();
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(i, j): (usize, usize)| {
                *midpoints.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    vertices.push((vertices[i] + vertices[j]).normalize());
                    vertices.len() - 1
                })
            });
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    let vertices = vertices
        .iter()
        .map(|v| Point3::from(v.cast::<f32>()))
        .collect();
    let triangles = triangles.iter().map(|t| t.map(|i| i as u32)).collect();
    (vertices, triangles)
}

/// Sphere of radius `radius_mm` around the origin, and the smallest distance of its facets from the origin.
pub fn sphere(radius_mm: f64, levels: u32) -> (Vec<Point3<f32>>, Vec<[u32; 3]>, f64) {
    let (mut vertices, triangles) = icosphere(levels);
    vertices
        .iter_mut()
        .for_each(|vertex| *vertex *= radius_mm as f32);
    let inner_mm = triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| vertices[i as usize].coords.cast::<f64>());
            (b - a).cross(&(c - a)).normalize().dot(&a).abs()
        })
        .fold(f64::INFINITY, f64::min);
    (vertices, triangles, inner_mm)
}

/// A closed surface with hollows and ridges that hides parts of itself; about 100 mm across.
pub fn bumpy(levels: u32) -> (Vec<Point3<f32>>, Vec<[u32; 3]>) {
    let (mut vertices, triangles) = icosphere(levels);
    for vertex in &mut vertices {
        let v = *vertex;
        let bumps =
            0.25 * (5.0 * v.x).sin() * (4.0 * v.y).cos() + 0.1 * (9.0 * v.z + 3.0 * v.x).sin();
        *vertex *= 50.0 * (1.0 + bumps);
    }
    (vertices, triangles)
}
