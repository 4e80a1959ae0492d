//! A row of cells: corners and edges from left to right.

use super::field::Sample;
use super::inside::{InsideBits, right_of};
use super::numbers::{Numbers, Slice};
use super::shortcut::EdgePlace;

/// The cells between rows j and j + 1 of slices k and k + 1.
///
/// Every crossed edge belongs to a cell with crossings, so the numbers on a row of edges are consumed in
/// order as these cells are visited in order.
pub struct CellRow<'a> {
    /// Inside bits by the corner bits of y and z.
    inside: [&'a [u64]; 4],
    /// Numbers on edges along x by the corner bits of y and z, along y by that of z, along z by that of y.
    numbers: [&'a [u32]; 8],
    /// Number of them that belong to edges left of the cell.
    used: [u32; 8],
}

impl<'a> CellRow<'a> {
    pub fn new<T: Sample>(
        inside: &'a InsideBits<T>,
        [low, high]: [&'a Slice; 2],
        upright: &'a Numbers,
        [j, k]: [usize; 2],
    ) -> Self {
        let ([low_x, low_y], [high_x, high_y]) = (&low.along, &high.along);
        Self {
            inside: [
                inside.row(j, k),
                inside.row(j + 1, k),
                inside.row(j, k + 1),
                inside.row(j + 1, k + 1),
            ],
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
        let mut corners = [0; 8];
        for (pair, row) in corners.as_chunks_mut::<2>().0.iter_mut().zip(self.inside) {
            *pair = [row[word], right_of(row, word)];
        }
        corners
    }

    /// The number on a crossed edge.
    #[inline]
    pub fn id(&self, edge: EdgePlace) -> u32 {
        let row = edge.row();
        self.numbers[row][(self.used[row] + edge.further()) as usize]
    }

    /// Moves on to the next cell with crossings; `crossed` counts crossed edges on this cell's left side and along x.
    #[inline]
    pub fn advance(&mut self, crossed: &[u32; 8]) {
        for (used, crossed) in self.used.iter_mut().zip(crossed) {
            *used += crossed;
        }
    }
}
