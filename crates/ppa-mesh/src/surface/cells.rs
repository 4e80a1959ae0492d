//! A row of cells: what lies at their corners and on their edges, from left to right.

use super::field::{Field, Sample};
use super::inside::{InsideBits, right_of};
use super::numbers::{Numbers, Slice};
use super::shortcut::EdgePlace;

/// The cells between rows j and j + 1 of slices k and k + 1.
///
/// Every crossed edge belongs to a cell with crossings, so that the numbers on a row of edges are used up in
/// their order while those cells are visited in theirs.
pub struct CellRow<'a, T> {
    /// By the corner bits of y and z.
    inside: [&'a [u64]; 4],
    hu: [&'a [T]; 4],
    /// Numbers on edges along x by the corner bits of y and z, along y by that of z, along z by that of y.
    numbers: [&'a [u32]; 8],
    /// How many of them belong to edges left of the cell.
    used: [u32; 8],
}

impl<'a, T: Sample> CellRow<'a, T> {
    pub fn new(
        field: &'a Field<T>,
        inside: &'a InsideBits,
        [low, high]: [&'a Slice; 2],
        upright: &'a Numbers,
        [j, k]: [usize; 2],
    ) -> Self {
        let rows = [(j, k), (j + 1, k), (j, k + 1), (j + 1, k + 1)];
        let ([low_x, low_y], [high_x, high_y]) = (&low.along, &high.along);
        Self {
            inside: rows.map(|(j, k)| inside.row(j, k)),
            hu: rows.map(|(j, k)| field.row(j, k)),
            numbers: [
                low_x.row(j),
                low_x.row(j + 1),
                high_x.row(j),
                high_x.row(j + 1),
                low_y.row(j),
                high_y.row(j),
                upright.row(j),
                upright.row(j + 1),
            ],
            used: [0; 8],
        }
    }

    /// The inside bits of 64 cells at once, by corner.
    pub fn corners(&self, word: usize) -> [u64; 8] {
        std::array::from_fn(|corner| {
            let row = self.inside[corner >> 1];
            match corner & 1 {
                0 => row[word],
                _ => right_of(row, word),
            }
        })
    }

    /// The number on a crossed edge.
    #[inline]
    pub fn id(&self, edge: EdgePlace) -> u32 {
        let row = edge.row();
        self.numbers[row][(self.used[row] + edge.further()) as usize]
    }

    /// Leaves the cell, of whose left side and edges along x these are crossed, for the next with crossings.
    #[inline]
    pub fn advance(&mut self, crossed: &[u32; 8]) {
        for (used, crossed) in self.used.iter_mut().zip(crossed) {
            *used += crossed;
        }
    }

    /// HU at the corners.
    #[inline]
    pub fn hu(&self, i: usize) -> [f32; 8] {
        let [p, q, r, s] = &self.hu;
        [
            p[i].into(),
            p[i + 1].into(),
            q[i].into(),
            q[i + 1].into(),
            r[i].into(),
            r[i + 1].into(),
            s[i].into(),
            s[i + 1].into(),
        ]
    }
}
