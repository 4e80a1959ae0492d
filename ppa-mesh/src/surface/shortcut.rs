//! Cells with one loop and no ambiguous face: nearly all of them, filled without looking at their values, or only at those that select a diagonal.

use std::sync::LazyLock;

use super::cell::{CONFIGURATIONS, Configuration, Disk, edge_corners};

/// Position of the number on a crossed edge of a cell: the row, of the eight rows of edges that the cell
/// touches, and whether an edge of that row on the cell's left side is crossed as well and comes first.
#[derive(Debug, Clone, Copy, Default)]
pub struct EdgePlace(u8);

impl EdgePlace {
    /// For a cell with these inside corners.
    pub fn new(inside: u8, edge: u8) -> Self {
        let (row, is_right) = row_and_side(edge);
        let left_is_crossed = is_right && row_crossed(inside, row);
        Self(row | u8::from(left_is_crossed) << 3)
    }

    /// 0 to 3 along x by the bits of y and z, 4 and 5 along y by that of z, 6 and 7 along z by that of y.
    #[inline]
    pub fn row(self) -> usize {
        usize::from(self.0 & 7)
    }

    #[inline]
    pub fn further(self) -> u32 {
        u32::from(self.0 >> 3)
    }
}

/// The row of edges that a cell edge belongs to, and whether it lies on the cell's right side.
fn row_and_side(edge: u8) -> (u8, bool) {
    let [first, last] = edge_corners(edge);
    let (x, y, z) = (first & 1, first >> 1 & 1, first >> 2);
    match first ^ last {
        1 => (y + 2 * z, false),
        2 => (4 + z, x == 1),
        _ => (6 + y, x == 1),
    }
}

/// Whether a row's edge along x or on the left side is crossed.
fn row_crossed(inside: u8, row: u8) -> bool {
    (0..12).any(|edge| row_and_side(edge) == (row, false) && is_crossed(inside, edge))
}

/// Whether one end of an edge is inside and one outside.
pub fn is_crossed(inside: u8, edge: u8) -> bool {
    let [a, b] = edge_corners(edge).map(|corner| inside >> corner & 1);
    a != b
}

/// Precomputed data of a sign configuration.
pub struct Shortcut {
    /// For each row of edges, how far its numbers advance to the next cell.
    pub crossed: [u32; 8],
    pub filling: Filling,
}

/// How a sign configuration is filled.
pub enum Filling {
    /// One loop with triangles that do not depend on the values: their number, and their corners.
    Triangles(usize, [[EdgePlace; 3]; 4]),
    /// One loop of four crossings.
    Quad(Quad),
    /// Nothing crosses, several loops, or ambiguous faces.
    Other,
}

/// Indexed as [`CONFIGURATIONS`].
pub static SHORTCUTS: LazyLock<[Shortcut; 256]> = LazyLock::new(|| {
    std::array::from_fn(|inside| Shortcut {
        crossed: std::array::from_fn(|row| row_crossed(inside as u8, row as u8).into()),
        filling: filling(inside as u8, &CONFIGURATIONS[inside]),
    })
});

fn filling(inside: u8, configuration: &Configuration) -> Filling {
    let [pattern] = &configuration.patterns[..] else {
        return Filling::Other;
    };
    let [Disk { ring, triangles }] = &pattern.disks[..] else {
        return Filling::Other;
    };
    if let [a, b, c, d] = ring[..] {
        return Filling::Quad(Quad::new(inside, [a, b, c, d]));
    }
    let mut list = [[EdgePlace::default(); 3]; 4];
    for (places, triangle) in list.iter_mut().zip(triangles) {
        *places = triangle.map(|edge| EdgePlace::new(inside, edge));
    }
    Filling::Triangles(triangles.len(), list)
}

/// A loop of four crossings: around four parallel edges of the cell, or around one edge of which both ends are
/// on one side and all other corners on the other.
pub struct Quad {
    /// Positions of its numbers.
    pub ring: [EdgePlace; 4],
    /// The ends of the edges in the order of the ring.
    near: [u8; 4],
    far: [u8; 4],
    /// The other two corners if the loop is around an edge.
    others: [u8; 2],
    /// 1 for parallel edges, otherwise 0.
    parallel: f32,
}

impl Quad {
    fn new(inside: u8, mut ring: [u8; 4]) -> Self {
        let axes = ring.map(|edge| edge / 4);
        let is_parallel = axes[0] == axes[1] && axes[1] == axes[2];
        // Around an edge: the first two crossings on parallel edges, so that pairs lie side by side.
        if axes[0] != axes[1] {
            ring.rotate_left(1);
        }
        let alone = inside.count_ones() == 2;
        let ends = ring.map(|edge| {
            let [first, last] = edge_corners(edge);
            match is_parallel || (inside >> first & 1 == 1) == alone {
                true => [first, last],
                false => [last, first],
            }
        });
        let met = |corner: &u8| ends.iter().any(|ends| ends.contains(corner));
        let others: Vec<u8> = (0..8).filter(|corner| !met(corner)).collect();
        Self {
            ring: ring.map(|edge| EdgePlace::new(inside, edge)),
            near: ends.map(|[near, _]| near),
            far: ends.map(|[_, far]| far),
            others: others.try_into().unwrap_or_default(),
            parallel: if is_parallel { 1.0 } else { 0.0 },
        }
    }

    /// Whether the diagonal from the first crossing has its middle nearer to the trilinear surface than the
    /// other one. `above` is HU above iso at the corners of the cell.
    #[inline]
    pub fn first_diagonal_fits_better(&self, above: &[f32; 8]) -> bool {
        let corners = |[p, q, r, s]: [u8; 4]| {
            let value = |corner: u8| above[usize::from(corner & 7)];
            [value(p), value(q), value(r), value(s)]
        };
        let (near, far) = (corners(self.near), corners(self.far));
        let mut t = [0.0; 4];
        for (t, (near, far)) in t.iter_mut().zip(near.iter().zip(&far)) {
            *t = near / (near - far);
        }
        // Between parallel edges the interpolant is linear along them, half-way across. Around an edge it is
        // bilinear across it, half-way along. Both are written as one, in sums over corners, so that no
        // branch is taken.
        let parallel = self.parallel;
        let base = near[0] + near[1] + parallel * (near[2] + near[3]);
        let (one, two) = (far[0] + far[1], far[2] + far[3]);
        let (u, v) = (one + parallel * two - base, two + parallel * one - base);
        let [p, q] = self.others.map(|corner| above[usize::from(corner & 7)]);
        let uv = (1.0 - parallel) * (p + q - base - u - v);
        let misfit = |s: f32, t: f32| {
            let (s, t) = (0.5 * s, 0.5 * t);
            (base + u * s + (v + uv * s) * t).abs()
        };
        misfit(t[0], t[2]) <= misfit(t[1], t[3])
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The trilinear interpolant of values at the corners of a cell.
    fn trilinear(values: &[f32; 8], at: [f64; 3]) -> f64 {
        let weighted = values.iter().enumerate().map(|(corner, &value)| {
            let weights = (0..3).map(|axis| match corner >> axis & 1 {
                1 => at[axis],
                _ => 1.0 - at[axis],
            });
            weights.product::<f64>() * f64::from(value)
        });
        weighted.sum()
    }

    proptest! {
        /// Every loop of four, against the definition in f64.
        #[test]
        fn the_diagonal_is_the_one_nearer_to_the_true_surface(
            size in prop::array::uniform8(1.0..1000.0_f32),
        ) {
            let mut quads = 0;
            for inside in 0..=255_u8 {
                let Filling::Quad(quad) = &SHORTCUTS[usize::from(inside)].filling else {
                    continue;
                };
                quads += 1;
                let above: [f32; 8] = std::array::from_fn(|corner| match inside >> corner & 1 {
                    1 => size[corner],
                    _ => -size[corner],
                });
                let crossing = |at: usize| {
                    let [near, far] = [quad.near[at], quad.far[at]].map(usize::from);
                    let t = f64::from(above[near]) / (f64::from(above[near]) - f64::from(above[far]));
                    [0, 1, 2].map(|axis| {
                        let [p, q] = [near, far].map(|corner| (corner >> axis & 1) as f64);
                        p + (q - p) * t
                    })
                };
                let misfit = |p: [f64; 3], q: [f64; 3]| {
                    trilinear(&above, [0, 1, 2].map(|axis| 0.5 * (p[axis] + q[axis]))).abs()
                };
                let first = misfit(crossing(0), crossing(2));
                let second = misfit(crossing(1), crossing(3));
                if (first - second).abs() > 1e-3 {
                    prop_assert_eq!(quad.first_diagonal_fits_better(&above), first < second);
                }
            }
            // Six faces and, twice, twelve edges.
            prop_assert_eq!(quads, 30);
        }
    }
}
