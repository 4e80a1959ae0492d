//! Blocks of equal cells, which rays cross in one step (empty-space skipping).

use rayon::prelude::*;

/// Cells along each side of a block.
const SIDE: usize = 4;

/// Distances of the blocks of a lattice to the next one in which values change.
#[derive(Debug, Clone)]
pub(super) struct Blocks {
    size: [usize; 3],
    /// Chessboard distance, in blocks, to the nearest mixed block or to the outside of the lattice, whichever is nearer; 0 for a mixed block.
    distance: Vec<u8>,
    /// The value of each block that is not mixed.
    values: Vec<bool>,
}

impl Blocks {
    /// Divides a lattice of `cells` into blocks. `common_value` returns the value of all cells from `low` (inclusive) to `high`
    /// (exclusive), or `None` if they differ.
    pub fn new(
        cells: [usize; 3],
        common_value: impl Fn([usize; 3], [usize; 3]) -> Option<bool> + Sync,
    ) -> Self {
        let size = cells.map(|n| n.div_ceil(SIDE));
        let value = |[i, j, k]: [usize; 3]| {
            let low = [i, j, k].map(|b| b * SIDE);
            let high = std::array::from_fn(|axis| (low[axis] + SIDE).min(cells[axis]));
            common_value(low, high)
        };
        let values: Vec<Option<bool>> = (0..size[2])
            .into_par_iter()
            .flat_map_iter(|k| layer(size, k).map(value))
            .collect();
        let border = |block: [usize; 3]| {
            // An incomplete last block ends earlier.
            let last = |axis: usize| (cells[axis] / SIDE).saturating_sub(block[axis]).max(1);
            let near = |axis: usize| (block[axis] + 1).min(last(axis));
            near(0).min(near(1)).min(near(2)).min(usize::from(u8::MAX)) as u8
        };
        let layers = (0..size[2]).flat_map(|k| layer(size, k));
        let distance = layers.zip(&values);
        let mut blocks = Self {
            size,
            distance: distance
                .map(|(block, value)| value.map_or(0, |_| border(block)))
                .collect(),
            values: values.iter().map(|value| value.unwrap_or(false)).collect(),
        };
        blocks.spread();
        blocks
    }

    /// Two passes give the chessboard distance: each block is at most one farther than its neighbours
    /// (Rosenfeld & Pfaltz, Pattern Recognition 1, 1968).
    fn spread(&mut self) {
        let size @ [nx, ny, nz] = self.size;
        let around = |n: usize, most: usize| n.saturating_sub(1)..(n + 2).min(most);
        let mut relax = |[i, j, k]: [usize; 3]| {
            let mut least = self.distance[(k * ny + j) * nx + i];
            for z in around(k, nz) {
                for y in around(j, ny) {
                    let row = (z * ny + y) * nx;
                    for near in &self.distance[row..][around(i, nx)] {
                        least = least.min(near.saturating_add(1));
                    }
                }
            }
            self.distance[(k * ny + j) * nx + i] = least;
        };
        let layers = || (0..nz).flat_map(|k| layer(size, k));
        layers().for_each(&mut relax);
        layers()
            .map(|[i, j, k]| [nx - 1 - i, ny - 1 - j, nz - 1 - k])
            .for_each(relax);
    }

    /// The value of a cell, and how many cells a point in it may move along each axis without leaving cells of that value; `None` in
    /// a mixed block.
    pub fn uniform(&self, cell: [usize; 3]) -> Option<(bool, usize)> {
        let [i, j, k] = cell.map(|c| c / SIDE);
        let block = (k * self.size[1] + j) * self.size[0] + i;
        let distance = self.distance[block].checked_sub(1)?;
        Some((self.values[block], usize::from(distance) * SIDE))
    }
}

/// The blocks of a layer, i fastest.
fn layer([nx, ny, _]: [usize; 3], k: usize) -> impl Iterator<Item = [usize; 3]> {
    (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k]))
}
