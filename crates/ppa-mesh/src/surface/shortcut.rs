//! Cells with one loop and no ambiguous face: nearly all, filled without a look at their values or only
//! at those that choose a diagonal.

use std::sync::LazyLock;

use super::cell::{CONFIGURATIONS, Configuration, Disk, edge_corners};

/// How a sign configuration is filled.
pub enum Shortcut {
    /// One loop with triangles that do not depend on the values: so many of these.
    Triangles(usize, [[u8; 3]; 4]),
    /// One loop of four crossings.
    Quad(Quad),
    /// Nothing crosses, several loops, or ambiguous faces.
    None,
}

/// Indexed as [`CONFIGURATIONS`].
pub static SHORTCUTS: LazyLock<Vec<Shortcut>> =
    LazyLock::new(|| CONFIGURATIONS.iter().map(shortcut).collect());

fn shortcut(configuration: &Configuration) -> Shortcut {
    let [pattern] = &configuration.patterns[..] else {
        return Shortcut::None;
    };
    let [Disk { ring, triangles }] = &pattern.disks[..] else {
        return Shortcut::None;
    };
    if let [a, b, c, d] = ring[..] {
        return Shortcut::Quad(Quad::new([a, b, c, d]));
    }
    let mut list = [[0; 3]; 4];
    list[..triangles.len()].copy_from_slice(triangles);
    Shortcut::Triangles(triangles.len(), list)
}

/// A loop of four crossings; everything by its place in the loop.
pub struct Quad {
    /// Cell edges.
    pub ring: [u8; 4],
    /// The ends of each edge.
    ends: [[u8; 2]; 4],
    /// By axis: the first end, and 1 on the axis that the edge runs along.
    first: [[f32; 4]; 3],
    along: [[f32; 4]; 3],
}

impl Quad {
    fn new(ring: [u8; 4]) -> Self {
        let ends = ring.map(edge_corners);
        Self {
            ring,
            ends,
            first: [0, 1, 2].map(|axis| ends.map(|[first, _]| f32::from(first >> axis & 1))),
            along: [0, 1, 2].map(|axis| ring.map(|edge| f32::from(u8::from(edge / 4 == axis)))),
        }
    }

    /// Whether the diagonal from the first crossing has its middle nearer to the trilinear surface than the
    /// other one. `above` is HU above iso at the corners of the cell.
    pub fn first_diagonal_fits_better(&self, above: &[f32; 8]) -> bool {
        let mut crossing = [0.0; 4];
        for (t, ends) in crossing.iter_mut().zip(&self.ends) {
            let [a, b] = ends.map(|corner| above[usize::from(corner & 7)]);
            *t = a / (a - b);
        }
        // The middles of both diagonals, by axis.
        let middle: [[f32; 2]; 3] = std::array::from_fn(|axis| {
            let (first, along) = (&self.first[axis], &self.along[axis]);
            let place: [f32; 4] = std::array::from_fn(|at| first[at] + along[at] * crossing[at]);
            [0.5 * (place[0] + place[2]), 0.5 * (place[1] + place[3])]
        });
        let misfit = |diagonal: usize| {
            let [x, y, z] = middle.map(|axis| axis[diagonal]);
            let along_x = |at: usize| above[at] + (above[at + 1] - above[at]) * x;
            let along_y = |at: usize| along_x(at) + (along_x(at + 2) - along_x(at)) * y;
            (along_y(0) + (along_y(4) - along_y(0)) * z).abs()
        };
        misfit(0) <= misfit(1)
    }
}
