//! A skin with fewer triangles, for display only.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};
use ppa_mesh::Mesh;

/// Side of the cells whose vertices are merged, mm. A lower leg then has about 50,000 triangles.
const CELL_MM: f32 = 2.5;

/// Merges the vertices within each cell of 2.5 mm to their mean. Returns the mesh and the means of the values at its vertices.
pub(crate) fn display_mesh(skin: &Mesh, values: &[f32]) -> (Mesh, Vec<f32>) {
    let cell = |p: &Point3<f32>| [p.x, p.y, p.z].map(|x| (x / CELL_MM).floor() as i32);
    let mut merged = HashMap::new();
    let mut sums: Vec<(Vector3<f32>, Vector3<f32>, f32)> = Vec::new();
    let mut indices = Vec::with_capacity(skin.vertices.len());
    let mut means = Vec::new();
    for (vertex, normal) in skin.vertices.iter().zip(&skin.normals) {
        let index = *merged.entry(cell(vertex)).or_insert_with(|| {
            sums.push(Default::default());
            sums.len() - 1
        });
        let (position, direction, count) = &mut sums[index];
        *position += vertex.coords;
        // The two faces of a sheet thinner than a cell merge into one, which is lit from either side.
        *direction += if normal.dot(direction) < 0.0 {
            -normal
        } else {
            *normal
        };
        *count += 1.0;
        indices.push(index as u32);
    }
    if !values.is_empty() {
        means.resize(sums.len(), 0.0);
        for (&index, value) in indices.iter().zip(values) {
            means[index as usize] += value / sums[index as usize].2;
        }
    }
    let corners = skin.triangles.iter();
    let corners = corners.map(|triangle| triangle.map(|id| indices[id as usize]));
    let merged = Mesh {
        vertices: sums.iter().map(|(sum, _, n)| (sum / *n).into()).collect(),
        normals: sums
            .iter()
            .map(|(_, sum, _)| sum.try_normalize(0.0).unwrap_or_default())
            .collect(),
        triangles: corners
            .filter(|[a, b, c]| a != b && b != c && c != a)
            .collect(),
    };
    (merged, means)
}

/// Returns the mesh as little-endian bytes: counts of vertices and triangles (u32), positions and normals (f32), corners (u32), and
/// values at the vertices (f32), if any.
pub(crate) fn bytes(mesh: &Mesh, values: &[f32]) -> Vec<u8> {
    let counts = [mesh.vertices.len() as u32, mesh.triangles.len() as u32];
    let positions = mesh.vertices.iter().flat_map(|v| [v.x, v.y, v.z]);
    let normals = mesh.normals.iter().flat_map(|n| [n.x, n.y, n.z]);
    let mut bytes: Vec<u8> = counts.iter().flat_map(|n| n.to_le_bytes()).collect();
    bytes.extend(positions.chain(normals).flat_map(f32::to_le_bytes));
    bytes.extend(
        mesh.triangles
            .iter()
            .flatten()
            .flat_map(|id| id.to_le_bytes()),
    );
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_faces_of_a_thin_sheet_become_one_that_is_lit() {
        let point = |n: u32, z: f32| Point3::new((n % 40) as f32, (n / 40) as f32, z);
        let faces = [(1.0, 1.0), (0.2, -1.0)];
        let sheet = Mesh {
            vertices: faces
                .iter()
                .flat_map(|(z, _)| (0..1600).map(|n| point(n, *z)))
                .collect(),
            normals: faces
                .iter()
                .flat_map(|(_, up)| vec![Vector3::z() * *up; 1600])
                .collect(),
            triangles: vec![[0, 10, 400]],
        };
        let (shown, _) = display_mesh(&sheet, &[]);
        assert_eq!(shown.vertices.len(), 256);
        assert!(shown.normals.iter().all(|normal| normal.z.abs() > 0.999));
    }

    #[test]
    fn merged_vertices_stay_within_a_cell_of_the_skin() {
        // A sheet of 1 mm squares.
        let point = |n: u32| Point3::new((n % 40) as f32, (n / 40) as f32, 0.3);
        let corners = (0..39 * 39).map(|n| n % 39 + 40 * (n / 39));
        let skin = Mesh {
            vertices: (0..1600).map(point).collect(),
            normals: vec![Vector3::z(); 1600],
            triangles: corners
                .flat_map(|a| [[a, a + 1, a + 41], [a, a + 41, a + 40]])
                .collect(),
        };
        let heights: Vec<f32> = skin.vertices.iter().map(|v| v.y).collect();
        let (shown, values) = display_mesh(&skin, &heights);
        assert!(shown.triangles.len() * 4 < skin.triangles.len());
        for vertex in &shown.vertices {
            assert!((vertex.z - 0.3).abs() < 1e-6);
            let near = skin.vertices.iter().map(|v| (v - vertex).norm());
            assert!(near.fold(f32::INFINITY, f32::min) < CELL_MM);
        }
        let pairs = shown.vertices.iter().zip(&values);
        assert!(pairs.clone().count() == shown.vertices.len());
        assert!(
            pairs
                .into_iter()
                .all(|(v, value)| (v.y - value).abs() < 1e-3)
        );
        let size = bytes(&shown, &values).len();
        assert_eq!(
            size,
            8 + 28 * shown.vertices.len() + 12 * shown.triangles.len()
        );
    }
}
