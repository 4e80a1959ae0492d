//! Where a mesh passes through itself.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::mesh::Mesh;

/// Number of cells along an axis that fit into a key; cells beyond share the last one.
const LAST_CELL: f64 = ((1 << 21) - 1) as f64;

impl Mesh {
    /// Pairs of triangles that pass through each other, the lower index first, in order.
    ///
    /// Triangles that touch, overlap in one plane, or share an edge do not count.
    pub fn self_crossings(&self) -> Vec<[u32; 2]> {
        let places: Vec<Point3<f64>> = self.vertices.iter().map(|v| v.cast()).collect();
        self_crossings(&places, &self.triangles)
    }
}

/// The same as [`Mesh::self_crossings`] for triangles between `places`.
pub fn self_crossings(places: &[Point3<f64>], triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let boxes: Vec<[Point3<f64>; 2]> = triangles
        .par_iter()
        .map(|triangle| {
            let [a, b, c] = triangle.map(|v| places[v as usize]);
            [a.inf(&b).inf(&c), a.sup(&b).sup(&c)]
        })
        .collect();
    let Some(low) = boxes.iter().map(|b| b[0]).reduce(|a, b| a.inf(&b)) else {
        return Vec::new();
    };
    let extents = || boxes.iter().map(|[low, high]| (high - low).max());
    let mean_mm = extents().sum::<f64>() / boxes.len() as f64;
    // A few large triangles among many small ones must not fill too many cells.
    let cell_mm = (2.0 * mean_mm).max(extents().fold(0.0, f64::max) / 32.0);
    if !(cell_mm > 0.0 && cell_mm.is_finite()) {
        return Vec::new();
    }
    let cell = |p: &Point3<f64>| ((p - low) / cell_mm).map(|c| c.min(LAST_CELL) as u64);
    let mut entries: Vec<(u64, u32)> = (0..boxes.len() as u32)
        .into_par_iter()
        .flat_map_iter(|triangle| {
            let [first, last] = boxes[triangle as usize].map(|corner| cell(&corner));
            let keys = (first.z..=last.z).flat_map(move |z| {
                (first.y..=last.y)
                    .flat_map(move |y| (first.x..=last.x).map(move |x| z << 42 | y << 21 | x))
            });
            keys.map(move |key| (key, triangle))
        })
        .collect();
    entries.par_sort_unstable();
    let cells: Vec<&[(u64, u32)]> = entries.chunk_by(|a, b| a.0 == b.0).collect();
    let mut found: Vec<[u32; 2]> = cells
        .par_iter()
        .flat_map_iter(|cell| {
            cell.iter().enumerate().flat_map(|(at, &(_, one))| {
                let others = cell[at + 1..].iter().map(move |&(_, other)| [one, other]);
                others.filter(|pair| {
                    let [[low, high], [l, h]] = pair.map(|t| boxes[t as usize]);
                    (0..3).all(|x| low[x] <= h[x] && l[x] <= high[x])
                        && cross(places, pair.map(|t| triangles[t as usize]))
                })
            })
        })
        .collect();
    // A pair is found in every cell that both overlap.
    found.par_sort_unstable();
    found.dedup();
    found
}

fn cross(places: &[Point3<f64>], [one, other]: [[u32; 3]; 2]) -> bool {
    let pierces = |edges: [u32; 3], through: [u32; 3]| {
        let corners = through.map(|v| places[v as usize]);
        (0..3).any(|at| {
            let ends = [edges[at], edges[(at + 1) % 3]];
            !ends.iter().any(|end| through.contains(end))
                && segment_pierces(ends.map(|v| places[v as usize]), corners)
        })
    };
    pierces(one, other) || pierces(other, one)
}

/// Whether a segment goes from one side of a triangle to the other through its inside.
fn segment_pierces([p, q]: [Point3<f64>; 2], [a, b, c]: [Point3<f64>; 3]) -> bool {
    let normal = (b - a).cross(&(c - a));
    if normal.dot(&(p - a)) * normal.dot(&(q - a)) >= 0.0 {
        return false;
    }
    let along = q - p;
    let side = |from: &Point3<f64>, to: &Point3<f64>| {
        let [from, to]: [Vector3<f64>; 2] = [from - p, to - p];
        along.dot(&from.cross(&to))
    };
    let sides = [side(&a, &b), side(&b, &c), side(&c, &a)];
    sides.iter().all(|s| *s > 0.0) || sides.iter().all(|s| *s < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(points: &[[f32; 3]], triangles: &[[u32; 3]]) -> Mesh {
        Mesh {
            vertices: points.iter().map(|p| Point3::from(*p)).collect(),
            normals: Vec::new(),
            triangles: triangles.to_vec(),
        }
    }

    #[test]
    fn only_what_passes_through_crosses() {
        let flat = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
        let with = |other: [[f32; 3]; 3]| {
            let points = [flat, other].concat();
            mesh(&points, &[[0, 1, 2], [3, 4, 5]]).self_crossings()
        };
        let through = with([[1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [5.0, 5.0, 1.0]]);
        assert_eq!(through, [[0, 1]]);
        let beside = with([[3.0, 3.0, -1.0], [3.0, 3.0, 1.0], [5.0, 5.0, 1.0]]);
        let standing_on = with([[1.0, 1.0, 0.0], [1.0, 1.0, 1.0], [2.0, 1.0, 1.0]]);
        let in_plane = with([[1.0, 1.0, 0.0], [3.0, 1.0, 0.0], [1.0, 3.0, 0.0]]);
        for none in [beside, standing_on, in_plane] {
            assert!(none.is_empty());
        }
        assert!(mesh(&[], &[]).self_crossings().is_empty());
    }

    #[test]
    fn triangles_at_one_vertex_may_cross() {
        let points = [
            [0.0, 0.0, 0.0],
            [4.0, 0.0, 0.0],
            [0.0, 4.0, 0.0],
            [1.0, 1.0, -1.0],
            [1.0, 1.0, 1.0],
            [3.0, 3.0, 1.0],
        ];
        let fan = |second| mesh(&points, &[[0, 1, 2], second]).self_crossings();
        assert_eq!(fan([0, 3, 4]), [[0, 1]]);
        assert!(fan([0, 4, 5]).is_empty());
        assert!(fan([0, 1, 4]).is_empty());
    }
}
