//! A row of cells: what lies at their corners and on their edges.

use super::crossings::Slice;
use super::field::{Field, Sample};
use super::inside::{InsideBits, right_of};

/// The cells between rows j and j + 1 of slices k and k + 1.
pub struct CellRow<'a, T> {
    /// By the corner bits of y and z.
    inside: [&'a [u64]; 4],
    hu: [&'a [T]; 4],
    /// Numbers on edges along x by the corner bits of y and z, along y by that of z, along z by that of y.
    along_x: [&'a [u32]; 4],
    along_y: [&'a [u32]; 2],
    along_z: [&'a [u32]; 2],
}

impl<'a, T: Sample> CellRow<'a, T> {
    pub fn new(
        field: &'a Field<T>,
        inside: &'a InsideBits,
        [low, high]: [&'a Slice; 2],
        upright: &'a [u32],
        [j, k]: [usize; 2],
    ) -> Self {
        let nx = field.size()[0];
        let row = |numbers: &'a [u32], j: usize| &numbers[nx * j..nx * (j + 1)];
        let rows = [(j, k), (j + 1, k), (j, k + 1), (j + 1, k + 1)];
        let [low_x, high_x] = [low, high].map(|slice| &slice.along[0]);
        Self {
            inside: rows.map(|(j, k)| inside.row(j, k)),
            hu: rows.map(|(j, k)| field.row(j, k)),
            along_x: [
                row(low_x, j),
                row(low_x, j + 1),
                row(high_x, j),
                row(high_x, j + 1),
            ],
            along_y: [low, high].map(|slice| row(&slice.along[1], j)),
            along_z: [row(upright, j), row(upright, j + 1)],
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

    /// Vertex numbers by cell edge; meaningless where nothing crosses.
    pub fn ids(&self, i: usize) -> [u32; 12] {
        let [x, y, z] = [&self.along_x[..], &self.along_y, &self.along_z];
        [
            x[0][i],
            x[1][i],
            x[2][i],
            x[3][i],
            y[0][i],
            y[1][i],
            y[0][i + 1],
            y[1][i + 1],
            z[0][i],
            z[0][i + 1],
            z[1][i],
            z[1][i + 1],
        ]
    }

    /// HU at the corners.
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
