//! The surface inside one cell: a table derived from a rule.
//!
//! Corners are numbered by bits (x = 1, y = 2, z = 4), edge `4 axis + o` runs along `axis` from the
//! corner whose bits on the two following axes are `o`, and face `2 axis + side` is normal to
//! `axis`. On every face each stretch of the border inside the body is cut off by a segment; where
//! two diagonal corners are inside and two outside, one bit says whether the inside ones are
//! joined (asymptotic decider, Nielson and Hamann 1991, doi:10.1109/VISUAL.1991.175782). Both
//! cells at a face see the same four values and decide alike, so segments always close to loops
//! and the surface never has a hole. Each loop is filled by the triangulation whose diagonals stay
//! nearest to the trilinear surface of the sign pattern, without diagonals within a face: the
//! neighbour could have chosen the same one, and four triangles would meet in it. Where there is none,
//! the loop is a fan about an extra vertex.

use std::sync::LazyLock;

/// Filling of one loop of edge crossings.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Disk {
    /// Cell edges in order; the body (inside) is on the side that makes this counter-clockwise
    /// seen from outside.
    pub ring: Vec<u8>,
    /// Triangles as cell edges; empty when the loop needs an extra vertex in its middle.
    pub triangles: Vec<[u8; 3]>,
}

/// All loops of one sign pattern with its ambiguous faces decided.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Pattern {
    /// One entry per loop.
    pub disks: Vec<Disk>,
}

/// The patterns of one of the 256 sign configurations.
#[derive(Debug, Clone, Default)]
pub struct Configuration {
    /// Faces whose inside corners are two diagonal ones.
    pub ambiguous: Vec<u8>,
    /// Indexed by one bit per ambiguous face, set when the inside corners are joined.
    pub patterns: Vec<Pattern>,
}

/// Indexed by the inside corners as bits.
pub static CONFIGURATIONS: LazyLock<Vec<Configuration>> =
    LazyLock::new(|| (0..256).map(|inside| configuration(inside as u8)).collect());

/// The two corners of an edge, the one nearer the origin first.
pub const fn edge_corners(edge: u8) -> [u8; 2] {
    let axis = edge / 4;
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let base = ((edge & 1) << u) | ((edge >> 1 & 1) << v);
    [base, base | (1 << axis)]
}

/// The corners (0, 0), (1, 0), (1, 1), (0, 1) of a face on the two axes after its normal.
pub const fn face_corners(face: u8) -> [u8; 4] {
    let axis = face / 2;
    let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
    let base = (face & 1) << axis;
    [base, base | u, base | u | v, base | v]
}

/// Whether the inside corners of an ambiguous face are joined by the bilinear interpolant.
///
/// `values` are HU above iso at the corners of the whole cell. The sign of the saddle value decides:
/// (ac − bd) / (a + c − b − d), with a, c on one diagonal.
pub fn inside_joined(face: u8, values: &[f64; 8]) -> bool {
    let [a, b, c, d] = face_corners(face).map(|corner| values[corner as usize]);
    let saddle = a * c - b * d;
    if a >= 0.0 {
        saddle >= 0.0
    } else {
        saddle <= 0.0
    }
}

fn edge_between(from: u8, to: u8) -> u8 {
    let axis = (from ^ to).trailing_zeros() as u8;
    let base = from & to;
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    4 * axis + ((base >> u & 1) | (base >> v & 1) << 1)
}

fn share_a_face(a: u8, b: u8) -> bool {
    let [a, b] = [a, b].map(edge_corners);
    let common = |bits: fn(u8, u8) -> u8| bits(bits(a[0], a[1]), bits(b[0], b[1]));
    // All four corners have a coordinate 1 in common, or a coordinate 0.
    common(|p, q| p & q) != 0 || common(|p, q| p | q) != 7
}

fn configuration(inside: u8) -> Configuration {
    let is_inside = |corner: u8| inside >> corner & 1 == 1;
    let ambiguous: Vec<u8> = (0..6)
        .filter(|&face| {
            let [a, b, c, d] = face_corners(face).map(is_inside);
            a == c && b == d && a != b
        })
        .collect();
    let patterns = (0..1_u32 << ambiguous.len())
        .map(|decisions| {
            let joined = |face: u8| {
                let bit = ambiguous.iter().position(|&f| f == face);
                bit.is_some_and(|bit| decisions >> bit & 1 == 1)
            };
            Pattern {
                disks: loops(&is_inside, &joined)
                    .into_iter()
                    .map(|ring| fill(inside, ring))
                    .collect(),
            }
        })
        .collect();
    Configuration {
        ambiguous,
        patterns,
    }
}

/// Follows the segments of all faces around the cell.
fn loops(is_inside: &dyn Fn(u8) -> bool, joined: &dyn Fn(u8) -> bool) -> Vec<Vec<u8>> {
    let mut next = [None; 12];
    for face in 0..6 {
        // Counter-clockwise seen from outside the cell, so that the border of the neighbouring
        // face runs through their common edge the other way.
        let mut corners = face_corners(face);
        if face & 1 == 0 {
            corners.reverse();
        }
        let mut leaving = Vec::new();
        let mut entering = Vec::new();
        for at in 0..4 {
            let (from, to) = (corners[at], corners[(at + 1) % 4]);
            match (is_inside(from), is_inside(to)) {
                (true, false) => leaving.push((at, edge_between(from, to))),
                (false, true) => entering.push((at, edge_between(from, to))),
                _ => {}
            }
        }
        for &(at, edge) in &entering {
            // A segment around one inside corner ends where the border leaves the body next after
            // `at`; around one outside corner, where it left it before.
            let steps = |&(other, _): &(usize, u8)| match joined(face) {
                true => (at + 4 - other) % 4,
                false => (other + 4 - at) % 4,
            };
            let end = leaving.iter().min_by_key(|candidate| steps(candidate));
            next[edge as usize] = end.map(|&(_, edge)| edge);
        }
    }
    let mut rings = Vec::new();
    for start in 0..12_u8 {
        let mut ring = Vec::new();
        let mut edge = start;
        while let Some(following) = next[edge as usize].take() {
            ring.push(edge);
            edge = following;
        }
        if !ring.is_empty() {
            rings.push(ring);
        }
    }
    rings
}

fn middle(edge: u8) -> [f64; 3] {
    let [p, q] = edge_corners(edge);
    [0, 1, 2].map(|axis| 0.5 * f64::from((p >> axis & 1) + (q >> axis & 1)))
}

/// Length of an interior edge between two crossings; infinite within a face.
pub fn diagonal_cost(a: u8, b: u8) -> f64 {
    if share_a_face(a, b) {
        return f64::INFINITY;
    }
    let (a, b) = (middle(a), middle(b));
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

/// How far the middle of a diagonal is from the surface: the trilinear interpolant there of ±1 at
/// the corners; infinite within a face. Length settles ties.
fn diagonal_misfit(inside: u8, a: u8, b: u8) -> f64 {
    let (p, q) = (middle(a), middle(b));
    let at = [0, 1, 2].map(|axis| 0.5 * (p[axis] + q[axis]));
    let value = (0..8).map(|corner| {
        let weights = [0, 1, 2].map(|axis| match corner >> axis & 1 {
            1 => at[axis],
            _ => 1.0 - at[axis],
        });
        let sign = if inside >> corner & 1 == 1 { 1.0 } else { -1.0 };
        sign * weights.iter().product::<f64>()
    });
    value.sum::<f64>().powi(2) + 1e-3 * diagonal_cost(a, b)
}

/// Triangulation of least total misfit (dynamic programming over sub-polygons).
fn fill(inside: u8, ring: Vec<u8>) -> Disk {
    let n = ring.len();
    let side = |i: usize, j: usize| match j - i {
        1 => 0.0,
        gap if gap == n - 1 => 0.0,
        _ => diagonal_misfit(inside, ring[i], ring[j]),
    };
    let mut cost = vec![vec![0.0; n]; n];
    let mut apex = vec![vec![0; n]; n];
    for gap in 2..n {
        for i in 0..n - gap {
            let j = i + gap;
            cost[i][j] = f64::INFINITY;
            for k in i + 1..j {
                let total = cost[i][k] + cost[k][j] + side(i, k) + side(k, j);
                if total < cost[i][j] {
                    (cost[i][j], apex[i][j]) = (total, k);
                }
            }
        }
    }
    let mut triangles = Vec::new();
    if cost[0][n - 1].is_finite() {
        let mut open = vec![(0, n - 1)];
        while let Some((i, j)) = open.pop() {
            if j - i >= 2 {
                let k = apex[i][j];
                triangles.push([ring[i], ring[k], ring[j]]);
                open.extend([(i, k), (k, j)]);
            }
        }
    }
    Disk { ring, triangles }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_crossing_lies_in_exactly_one_loop() {
        for (inside, configuration) in CONFIGURATIONS.iter().enumerate() {
            let crossed = (0..12_u8)
                .filter(|&e| {
                    edge_corners(e).map(|c| inside >> c & 1) == [0, 1]
                        || edge_corners(e).map(|c| inside >> c & 1) == [1, 0]
                })
                .collect::<Vec<_>>();
            for pattern in &configuration.patterns {
                let mut seen: Vec<u8> = pattern.disks.iter().flat_map(|d| d.ring.clone()).collect();
                seen.sort_unstable();
                assert_eq!(seen, crossed, "configuration {inside:08b}");
                for disk in &pattern.disks {
                    assert!(disk.ring.len() >= 3);
                    assert!(
                        disk.triangles.is_empty() || disk.triangles.len() == disk.ring.len() - 2
                    );
                }
            }
        }
    }

    #[test]
    fn extra_vertices_are_only_needed_where_faces_are_ambiguous() {
        for configuration in CONFIGURATIONS.iter().filter(|c| c.ambiguous.is_empty()) {
            let disks = configuration.patterns.iter().flat_map(|p| &p.disks);
            assert!(disks.into_iter().all(|disk| !disk.triangles.is_empty()));
        }
    }
}
