//! Numbers and vertices of the crossings on the edges of the lattice.

use nalgebra::Vector3;

use super::field::{Sample, Stencil};
use super::inside::ones;
use super::slab::March;

/// Vertex numbers of one slice.
pub struct Slice {
    /// Voxels that are vertices because they equal the iso value, ascending, with their numbers.
    at_voxel: Vec<(u32, u32)>,
    /// Numbers on edges along x and y, by the edge's first voxel; meaningless where nothing crosses.
    pub along: [Vec<u32>; 2],
}

impl Slice {
    /// For slices of so many voxels.
    pub fn new(voxels: usize) -> Self {
        Self {
            at_voxel: Vec::new(),
            along: [vec![0; voxels], vec![0; voxels]],
        }
    }

    /// The number of a voxel that equals the iso value and has an outside neighbour.
    fn number_at(&self, voxel: usize) -> u32 {
        let later = (self.at_voxel).partition_point(|&(at, _)| at <= voxel as u32);
        self.at_voxel[later - 1].1
    }
}

impl<T: Sample> March<'_, T> {
    /// Numbers the vertices of slice k from `first` on and, when it is `own`, stores them.
    pub fn number(&mut self, slice: &mut Slice, k: usize, first: u32, own: bool) {
        let ny = self.field.size()[1];
        let mut next = first;
        slice.at_voxel.clear();
        for j in 0..ny {
            self.number_voxels(slice, [j, k], &mut next, own);
        }
        for j in 0..ny {
            self.number_edges(slice, [j, k], &mut next, own);
        }
    }

    /// First all voxels of a row that are vertices themselves, as edges from all sides refer to them.
    fn number_voxels(&mut self, slice: &mut Slice, [j, k]: [usize; 2], next: &mut u32, own: bool) {
        for word in 0..self.inside.words() {
            let at_surface = self.inside.at_surface(j, k, word);
            if at_surface == 0 {
                continue;
            }
            let row = self.field.stencil(j, k);
            for i in ones(at_surface).map(|bit| 64 * word + bit) {
                if row.hu(i) == self.field.iso() {
                    let voxel = i + self.field.size()[0] * j;
                    slice.at_voxel.push((voxel as u32, *next));
                    *next += 1;
                    if own {
                        self.push([i, j, k].map(|v| v as f64).into(), row.gradient(i));
                    }
                }
            }
        }
    }

    fn number_edges(&mut self, slice: &mut Slice, [j, k]: [usize; 2], next: &mut u32, own: bool) {
        let [nx, ny, _] = self.field.size();
        let iso = self.field.iso();
        for word in 0..self.inside.words() {
            let here = self.inside.row(j, k);
            let along_x = self.inside.crossed_along_x(here, word);
            let along_y = match j + 1 < ny {
                true => here[word] ^ self.inside.row(j + 1, k)[word],
                false => 0,
            };
            if along_x | along_y == 0 {
                continue;
            }
            let inside = here[word];
            let rows = [j, (j + 1).min(ny - 1)].map(|j| self.field.stencil(j, k));
            for bit in ones(along_x | along_y) {
                let i = 64 * word + bit;
                let voxel = i + nx * j;
                let is_inside = inside >> bit & 1 == 1;
                for (axis, crossed) in [along_x, along_y].into_iter().enumerate() {
                    if crossed >> bit & 1 == 0 {
                        continue;
                    }
                    let (step, far) = [(1, (&rows[0], i + 1)), (nx, (&rows[1], i))][axis];
                    let (inner, hu) = match is_inside {
                        true => (voxel, rows[0].hu(i)),
                        false => (voxel + step, far.0.hu(far.1)),
                    };
                    slice.along[axis][voxel] = if hu == iso {
                        slice.number_at(inner)
                    } else {
                        if own {
                            self.cross([i, j, k], axis, (&rows[0], i), far);
                        }
                        *next += 1;
                        *next - 1
                    };
                }
            }
        }
    }

    /// Numbers and stores the vertices on the edges between two slices.
    pub fn number_upright(&mut self, upright: &mut [u32], k: usize, low: &Slice, high: &Slice) {
        let [nx, ny, _] = self.field.size();
        for j in 0..ny {
            for word in 0..self.inside.words() {
                let below = self.inside.row(j, k)[word];
                let crossed = below ^ self.inside.row(j, k + 1)[word];
                if crossed == 0 {
                    continue;
                }
                let rows = [k, k + 1].map(|k| self.field.stencil(j, k));
                for bit in ones(crossed) {
                    let i = 64 * word + bit;
                    let voxel = i + nx * j;
                    let (inner, row) = match below >> bit & 1 {
                        1 => (low, &rows[0]),
                        _ => (high, &rows[1]),
                    };
                    upright[voxel] = match row.hu(i) == self.field.iso() {
                        true => inner.number_at(voxel),
                        false => self.cross([i, j, k], 2, (&rows[0], i), (&rows[1], i)),
                    };
                }
            }
        }
    }

    /// Stores the crossing on the edge from a voxel along an axis, whose ends lie in these rows.
    fn cross(
        &mut self,
        [x, y, z]: [usize; 3],
        axis: usize,
        (row, i): (&Stencil<T>, usize),
        (far_row, far_i): (&Stencil<T>, usize),
    ) -> u32 {
        let iso = f64::from(self.field.iso());
        let (a, b) = (
            f64::from(row.hu(i)) - iso,
            f64::from(far_row.hu(far_i)) - iso,
        );
        let nearest = self.world.nearest;
        let t = (a / (a - b)).clamp(nearest, 1.0 - nearest);
        let mut place = Vector3::new(x as f64, y as f64, z as f64);
        place[axis] += t;
        let (near, far) = (row.gradient(i), far_row.gradient(far_i));
        self.push(place, near + (far - near) * t as f32)
    }
}
