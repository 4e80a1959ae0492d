//! Connected pieces of a mask, kept as runs of voxels along x.

use std::ops::Range;

use super::lattice::Lattice;
use crate::topology::{join, root};

/// Pieces of a mask connected through faces, numbered by their first voxel.
pub struct Pieces {
    /// Voxels of each run, in order.
    runs: Vec<Range<u32>>,
    /// Piece of each run.
    labels: Vec<u32>,
    pub count: usize,
}

impl Pieces {
    pub fn of(lattice: &Lattice, inside: impl Fn(usize) -> bool) -> Self {
        let [nx, ny, nz] = lattice.size;
        let mut runs: Vec<Range<u32>> = Vec::new();
        let mut rows = vec![0];
        for row in 0..ny * nz {
            let (mut at, end) = (row * nx, (row + 1) * nx);
            while at < end {
                let start = at;
                while at < end && inside(at) {
                    at += 1;
                }
                if start < at {
                    runs.push(start as u32..at as u32);
                }
                at += 1;
            }
            rows.push(runs.len());
        }
        let mut parent: Vec<u32> = (0..runs.len() as u32).collect();
        for row in 0..ny * nz {
            for (there, back) in [(row % ny > 0, 1), (row >= ny, ny)] {
                if there {
                    let [here, before] = [row, row - back].map(|row| rows[row]..rows[row + 1]);
                    join_touching(&runs, here, before, (back * nx) as u32, &mut parent);
                }
            }
        }
        let mut labels = vec![0; runs.len()];
        let mut count = 0;
        for run in 0..runs.len() {
            // A root is the first run of its piece, so it is labelled first.
            let first = root(&mut parent, run as u32) as usize;
            if first == run {
                labels[run] = count;
                count += 1;
            } else {
                labels[run] = labels[first];
            }
        }
        Self {
            runs,
            labels,
            count: count as usize,
        }
    }

    /// The runs of voxels with the piece each belongs to.
    pub fn runs(&self) -> impl Iterator<Item = (usize, Range<usize>)> {
        let voxels = |run: &Range<u32>| run.start as usize..run.end as usize;
        let labels = self.labels.iter().map(|&label| label as usize);
        labels.zip(self.runs.iter().map(voxels))
    }

    /// The runs of voxels and whether their piece does not touch the border of the box.
    pub fn enclosed(&self, lattice: &Lattice) -> impl Iterator<Item = (bool, Range<usize>)> {
        let mut open = vec![false; self.count];
        for (piece, run) in self.runs() {
            let [first, last] = [run.start, run.end - 1].map(|at| lattice.voxel(at));
            open[piece] |= (0..3).any(|x| first[x] == 0 || last[x] + 1 == lattice.size[x]);
        }
        self.runs().map(move |(piece, run)| (!open[piece], run))
    }

    /// Number of voxels of each piece.
    pub fn sizes(&self) -> Vec<usize> {
        let mut sizes = vec![0; self.count];
        for (piece, voxels) in self.runs() {
            sizes[piece] += voxels.len();
        }
        sizes
    }
}

/// Joins the runs of two rows that overlap once the earlier row is moved by `shift` voxels.
fn join_touching(
    runs: &[Range<u32>],
    mut here: Range<usize>,
    mut before: Range<usize>,
    shift: u32,
    parent: &mut [u32],
) {
    while !here.is_empty() && !before.is_empty() {
        let (a, b) = (&runs[here.start], &runs[before.start]);
        let b = b.start + shift..b.end + shift;
        if a.start < b.end && b.start < a.end {
            join(parent, here.start as u32, before.start as u32);
        }
        if a.end <= b.end {
            here.start += 1;
        } else {
            before.start += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        #[test]
        fn neighbours_share_a_piece_and_pieces_are_numbered_in_order(
            size in prop::array::uniform3(1..6_usize),
            mask in prop::collection::vec(any::<bool>(), 125),
        ) {
            let lattice = Lattice {
                low: [0; 3],
                size,
                whole: size,
                spacing_mm: [1.0; 3],
            voxel_mm3: 1.0,
            face_mm2: [1.0; 3],
                scan_axis: 2,
            };
            let pieces = Pieces::of(&lattice, |at| mask[at]);
            let mut found = vec![None; lattice.len()];
            for (piece, voxels) in pieces.runs() {
                found[voxels].fill(Some(piece));
            }
            // Flooding from every first voxel gives the same numbers.
            let mut expected = vec![None; lattice.len()];
            let mut count = 0;
            for start in 0..lattice.len() {
                let mut front = Vec::new();
                if mask[start] && expected[start].is_none() {
                    expected[start] = Some(count);
                    front.push(start);
                    count += 1;
                }
                while let Some(at) = front.pop() {
                    let voxel = lattice.voxel(at);
                    for (axis, stride) in lattice.strides().into_iter().enumerate() {
                        let below = (voxel[axis] > 0).then(|| at - stride);
                        let above = (voxel[axis] + 1 < size[axis]).then(|| at + stride);
                        for next in below.into_iter().chain(above) {
                            if mask[next] && expected[next].is_none() {
                                expected[next] = expected[at];
                                front.push(next);
                            }
                        }
                    }
                }
            }
            prop_assert_eq!(pieces.count, count);
            prop_assert_eq!(pieces.sizes().iter().sum::<usize>(), found.iter().flatten().count());
            prop_assert_eq!(found, expected);
        }
    }
}
