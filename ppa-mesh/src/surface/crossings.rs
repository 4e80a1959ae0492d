//! Vertices on the edges of the lattice.

use super::field::{Sample, Stencil};
use super::inside::{InsideBits, ones};
use super::march::March;
use super::numbers::{AT_VOXEL, Numbers, Slice};
use super::points::End;

impl<T: Sample> March<'_, T> {
    /// Numbers the voxels of slice k that are vertices themselves and, when the slice is `own`, stores them.
    pub fn voxels(&mut self, inside: &InsideBits<T>, slice: &mut Slice, k: usize, own: bool) {
        let [nx, ny, _] = self.field.size();
        slice.at_voxel.clear();
        let mut next = AT_VOXEL | self.part.at_voxels.vertices.len() as u32;
        for j in (0..ny).filter(|&j| inside.at_iso(j, k)) {
            let row = self.field.stencil(j, k);
            for word in 0..inside.words() {
                for bit in ones(inside.at_surface(j, k, word)) {
                    let i = 64 * word + bit;
                    if row.hu(i) != self.field.iso() {
                        continue;
                    }
                    slice.at_voxel.push(((i + nx * j) as u32, next));
                    next += 1;
                    if own {
                        let place = [i, j, k].map(|v| v as f64).into();
                        let gradient = row.gradient(i).into();
                        self.part.at_voxels.push(self.world, place, gradient);
                    }
                }
            }
        }
    }

    /// Numbers the vertices on the edges of slice k and, when it is `own`, stores them.
    pub fn edges_within(&mut self, inside: &InsideBits<T>, slice: &mut Slice, k: usize, own: bool) {
        let ny = self.field.size()[1];
        let [mut along_x, mut along_y] = std::mem::take(&mut slice.along);
        along_x.clear();
        along_y.clear();
        for j in 0..ny {
            self.edges(inside, &mut along_x, 0, [[j, k]; 2], [slice, slice], own);
            along_x.end_row();
        }
        self.store(0);
        for j in 0..ny {
            if j + 1 < ny {
                self.edges(
                    inside,
                    &mut along_y,
                    1,
                    [[j, k], [j + 1, k]],
                    [slice, slice],
                    own,
                );
            }
            along_y.end_row();
        }
        self.store(1);
        slice.along = [along_x, along_y];
    }

    /// Numbers and stores the vertices on the edges between slices k and k + 1.
    pub fn edges_between(
        &mut self,
        inside: &InsideBits<T>,
        upright: &mut Numbers,
        k: usize,
        slices: [&Slice; 2],
    ) {
        upright.clear();
        for j in 0..self.field.size()[1] {
            self.edges(inside, upright, 2, [[j, k], [j, k + 1]], slices, true);
            upright.end_row();
        }
        self.store(2);
    }

    /// The edges along an axis from the voxels of one row to those of another, or to the next in the same.
    fn edges(
        &mut self,
        inside: &InsideBits<T>,
        numbers: &mut Numbers,
        axis: usize,
        rows: [[usize; 2]; 2],
        slices: [&Slice; 2],
        own: bool,
    ) {
        let [[j, k], [far_j, far_k]] = rows;
        let [nx, step] = [self.field.size()[0], usize::from(axis == 0)];
        let (here, far) = (inside.row(j, k), inside.row(far_j, far_k));
        let may_merge = inside.at_iso(j, k) || inside.at_iso(far_j, far_k);
        let mut stencils: Option<[Stencil<T>; 2]> = None;
        for word in 0..inside.words() {
            let crossed = match axis {
                0 => inside.crossed_along_x(here, word),
                _ => here[word] ^ far[word],
            };
            if crossed == 0 {
                continue;
            }
            let [near, far] = stencils.get_or_insert_with(|| {
                [self.field.stencil(j, k), self.field.stencil(far_j, far_k)]
            });
            for bit in ones(crossed) {
                let i = 64 * word + bit;
                if may_merge {
                    let is_inside = here[word] >> bit & 1 == 1;
                    let (row, at, voxel, slice) = match is_inside {
                        true => (&*near, i, i + nx * j, slices[0]),
                        false => (&*far, i + step, i + step + nx * far_j, slices[1]),
                    };
                    if row.hu(at) == self.field.iso() {
                        numbers.push(slice.number_at(voxel));
                        continue;
                    }
                }
                numbers.push(self.crossings);
                self.crossings += 1;
                if own {
                    let end = |row: &Stencil<T>, i: usize| End {
                        hu: row.hu(i),
                        gradient: row.gradient(i),
                    };
                    if self
                        .batch
                        .add([i, j, k], [end(near, i), end(far, i + step)])
                    {
                        self.store(axis);
                    }
                }
            }
        }
    }

    /// Stores the pending crossings along an axis.
    fn store(&mut self, axis: usize) {
        let iso = self.field.iso();
        (self.batch).store(axis, iso, self.world, &mut self.part.crossings);
    }
}
