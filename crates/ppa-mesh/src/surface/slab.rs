//! Marching through a few layers of cells with the crossings of two slices in memory.

use std::ops::Range;

use nalgebra::Vector3;

use super::cell::{CONFIGURATIONS, edge_corners, inside_joined};
use super::field::Field;
use super::tunnel;

/// Marks a vertex of the first slice of the slab above.
pub const NEXT_SLAB: u32 = 1 << 31;

/// Crossings nearer to a voxel than this fraction of an edge are moved away from it: in f32 they
/// could coincide with one on another edge of that voxel.
const NEAREST: f64 = 1e-4;

/// Vertices and triangles of some layers of cells.
#[derive(Default)]
pub struct Slab {
    /// In voxel indices of the field.
    pub positions: Vec<Vector3<f64>>,
    /// HU per voxel step.
    pub gradients: Vec<Vector3<f64>>,
    /// Own vertices, or those of the next slab's first slice marked by [`NEXT_SLAB`].
    pub triangles: Vec<[u32; 3]>,
}

/// Vertex numbers of one slice. Entries are only meaningful where the lattice is crossed.
struct Slice {
    /// Inside bits, 64 voxels to a word, rows padded to whole words.
    inside: Vec<u64>,
    /// Vertices at voxels that equal the iso value.
    at_voxel: Vec<u32>,
    /// Vertices on edges along x and y.
    along: [Vec<u32>; 2],
}

/// The march with what it has made so far.
pub struct March<'a> {
    pub field: &'a Field<'a>,
    words: usize,
    pub slab: Slab,
}

/// Surface within the layers of cells between slices k and k + 1 for k in `layers`.
pub fn march(field: &Field, layers: Range<usize>) -> Slab {
    let mut march = March {
        field,
        words: field.size()[0].div_ceil(64),
        slab: Slab::default(),
    };
    let last_slice = field.size()[2] - 1;
    let mut low = march.slice(layers.start, 0, true);
    for k in layers.clone() {
        // The slice on top belongs to the slab above, if there is one; its numbers start at 0.
        let own = k + 1 < layers.end || k + 1 == last_slice;
        let first = if own {
            march.slab.positions.len() as u32
        } else {
            NEXT_SLAB
        };
        let high = march.slice(k + 1, first, own);
        let upright = march.upright(k, &low, &high);
        march.layer(k, &low, &high, &upright);
        low = high;
    }
    march.slab
}

impl March<'_> {
    fn bit(&self, slice: &Slice, i: usize, j: usize) -> bool {
        slice.inside[j * self.words + i / 64] >> (i % 64) & 1 == 1
    }

    fn inside_bits(&self, k: usize) -> Vec<u64> {
        let iso = self.field.iso();
        let mut words = Vec::with_capacity(self.words * self.field.size()[1]);
        for j in 0..self.field.size()[1] {
            words.extend(self.field.row(j, k).chunks(64).map(|chunk| {
                let bits = chunk.iter().enumerate();
                bits.fold(0, |word, (bit, &hu)| word | u64::from(hu >= iso) << bit)
            }));
        }
        words
    }

    /// Numbers the vertices of slice k from `first` on and, when it is `own`, stores them.
    fn slice(&mut self, k: usize, first: u32, own: bool) -> Slice {
        let [nx, ny, nz] = self.field.size();
        let mut slice = Slice {
            inside: self.inside_bits(k),
            at_voxel: vec![u32::MAX; nx * ny],
            along: [vec![u32::MAX; nx * ny], vec![u32::MAX; nx * ny]],
        };
        let mut next = first;
        let mut number = |march: &mut Self, from: [usize; 3], to: [usize; 3]| {
            if own {
                march.vertex(from, to);
            }
            next += 1;
            next - 1
        };
        // First all voxels that are vertices themselves, as edges from both sides refer to them.
        for j in 0..ny {
            let row = self.field.row(j, k);
            for i in (0..nx).filter(|&i| row[i] == self.field.iso()) {
                let at = self.field.index([i, j, k]);
                let outside = |there: bool, index: usize| there && self.field.above(index) < 0.0;
                if outside(i > 0, at.wrapping_sub(1))
                    || outside(i + 1 < nx, at + 1)
                    || outside(j > 0, at.wrapping_sub(nx))
                    || outside(j + 1 < ny, at + nx)
                    || outside(k > 0, at.wrapping_sub(nx * ny))
                    || outside(k + 1 < nz, at + nx * ny)
                {
                    slice.at_voxel[i + nx * j] = number(self, [i, j, k], [i, j, k]);
                }
            }
        }
        for j in 0..ny {
            for word in 0..self.words {
                let at = j * self.words + word;
                let here = slice.inside[at];
                let valid = u64::MAX >> (64 - (nx - 64 * word).min(64));
                let carry = if word + 1 < self.words {
                    slice.inside[at + 1] << 63
                } else {
                    here & (1 << 63)
                };
                // The last voxel of a row has no right neighbour.
                let last = if word + 1 == self.words {
                    1 << ((nx - 1) % 64)
                } else {
                    0
                };
                let x_crossed = (here ^ (here >> 1 | carry)) & valid & !last;
                let y_crossed = if j + 1 < ny {
                    (here ^ slice.inside[at + self.words]) & valid
                } else {
                    0
                };
                for bit in bits(x_crossed | y_crossed) {
                    let i = 64 * word + bit;
                    for (axis, crossed) in [x_crossed, y_crossed].into_iter().enumerate() {
                        if crossed >> bit & 1 == 0 {
                            continue;
                        }
                        let to = if axis == 0 { [i + 1, j] } else { [i, j + 1] };
                        let (a, b) = (i + nx * j, to[0] + nx * to[1]);
                        let inner = if here >> bit & 1 == 1 { a } else { b };
                        slice.along[axis][a] = match slice.at_voxel[inner] {
                            u32::MAX => number(self, [i, j, k], [to[0], to[1], k]),
                            id => id,
                        };
                    }
                }
            }
        }
        slice
    }

    /// Numbers and stores the vertices on the edges between two slices.
    fn upright(&mut self, k: usize, low: &Slice, high: &Slice) -> Vec<u32> {
        let [nx, ny, _] = self.field.size();
        let mut upright = vec![u32::MAX; nx * ny];
        for j in 0..ny {
            for word in 0..self.words {
                let at = j * self.words + word;
                for bit in bits(low.inside[at] ^ high.inside[at]) {
                    let i = 64 * word + bit;
                    let here = i + nx * j;
                    let inner = if low.inside[at] >> bit & 1 == 1 {
                        low
                    } else {
                        high
                    };
                    upright[here] = match inner.at_voxel[here] {
                        u32::MAX => self.vertex([i, j, k], [i, j, k + 1]),
                        id => id,
                    };
                }
            }
        }
        upright
    }

    /// Stores the crossing between two neighbouring voxels (or at one) and returns its number.
    fn vertex(&mut self, from: [usize; 3], to: [usize; 3]) -> u32 {
        let (a, b) = [from, to]
            .map(|v| self.field.above(self.field.index(v)))
            .into();
        let t = if from == to {
            0.0
        } else {
            (a / (a - b)).clamp(NEAREST, 1.0 - NEAREST)
        };
        let [p, q] = [from, to].map(|v| Vector3::from(v.map(|c| c as f64)));
        let position = p + (q - p) * t;
        let mut gradient = self.field.gradient(from);
        if from != to {
            gradient = gradient * (1.0 - t) + self.field.gradient(to) * t;
        }
        self.push(position, gradient)
    }

    pub fn push(&mut self, position: Vector3<f64>, gradient: Vector3<f64>) -> u32 {
        let id = self.slab.positions.len() as u32;
        self.slab.positions.push(position);
        self.slab.gradients.push(gradient);
        id
    }

    fn layer(&mut self, k: usize, low: &Slice, high: &Slice, upright: &[u32]) {
        let [nx, ny, _] = self.field.size();
        for j in 0..ny - 1 {
            for word in 0..self.words {
                let at = j * self.words + word;
                let (mut all, mut any) = (u64::MAX, 0);
                let (mut all_next, mut any_next) = (u64::MAX, 0);
                for slice in [low, high] {
                    for at in [at, at + self.words] {
                        let here = slice.inside[at];
                        (all, any) = (all & here, any | here);
                        if word + 1 < self.words {
                            let next = slice.inside[at + 1];
                            (all_next, any_next) = (all_next & next, any_next | next);
                        }
                    }
                }
                let all = all & (all >> 1 | (all_next & 1) << 63);
                let any = any | any >> 1 | (any_next & 1) << 63;
                let cells = (nx - 1).saturating_sub(64 * word).min(64);
                if cells == 0 {
                    continue;
                }
                for bit in bits(any & !all & (u64::MAX >> (64 - cells))) {
                    let i = 64 * word + bit;
                    self.cell([i, j, k], low, high, upright);
                }
            }
        }
    }

    fn cell(&mut self, [i, j, k]: [usize; 3], low: &Slice, high: &Slice, upright: &[u32]) {
        let nx = self.field.size()[0];
        let mut inside = 0_usize;
        for (corner, slice) in [low, low, low, low, high, high, high, high]
            .iter()
            .enumerate()
        {
            let bit = self.bit(slice, i + (corner & 1), j + (corner >> 1 & 1));
            inside |= usize::from(bit) << corner;
        }
        let id = |edge: u8| {
            let base = edge_corners(edge)[0] as usize;
            let at = i + (base & 1) + nx * (j + (base >> 1 & 1));
            let slice = if base >> 2 == 1 { high } else { low };
            match edge / 4 {
                2 => upright[at],
                axis => slice.along[axis as usize][at],
            }
        };
        let configuration = &CONFIGURATIONS[inside];
        let several = configuration.patterns[0].disks.len() > 1;
        let ambiguous = !configuration.ambiguous.is_empty();
        if !several && !ambiguous {
            let disk = &configuration.patterns[0].disks[0];
            if let [a, b, c, d] = disk.ring[..] {
                let [p, q, r, s] = [a, b, c, d].map(id);
                if first_diagonal_fits_better([a, b, c, d], &self.corner_values([i, j, k])) {
                    self.triangle([p, q, r]);
                    self.triangle([p, r, s]);
                } else {
                    self.triangle([p, q, s]);
                    self.triangle([q, r, s]);
                }
            } else {
                for triangle in &disk.triangles {
                    self.triangle(triangle.map(id));
                }
            }
            return;
        }

        let values = self.corner_values([i, j, k]);
        let mut decisions = 0;
        for (bit, &face) in configuration.ambiguous.iter().enumerate() {
            decisions |= usize::from(inside_joined(face, &values)) << bit;
        }
        let pattern = &configuration.patterns[decisions];
        // Voxels at the iso value merge vertices of a ring; extra vertices could then lie on its sides.
        let distinct = |ring: &[u8]| {
            let mut ids: Vec<u32> = ring.iter().map(|&edge| id(edge)).collect();
            ids.sort_unstable();
            ids.dedup();
            ids.len()
        };
        let mut tube = tunnel::tube(configuration, decisions, pattern, &values);
        if let Some(pair) = tube {
            let [first, second] = pair.map(|at| pattern.disks[at].ring.as_slice());
            match tunnel::tube_triangles(first, second) {
                Some(triangles) => triangles.iter().for_each(|t| self.triangle(t.map(id))),
                None if distinct(first) < first.len() || distinct(second) < second.len() => {
                    tube = None;
                }
                None => {
                    let rings = [first, second].map(|ring| ring.iter().map(|&e| id(e)).collect());
                    self.waist([i, j, k], [first, second], rings);
                }
            }
        }
        for (at, disk) in pattern.disks.iter().enumerate() {
            if tube.is_some_and(|pair| pair.contains(&at)) {
                continue;
            }
            if disk.triangles.is_empty() && distinct(&disk.ring) >= 3 {
                let ring: Vec<u32> = disk.ring.iter().map(|&edge| id(edge)).collect();
                let (position, gradient) = self.middle([i, j, k], &disk.ring);
                let middle = self.push(position, gradient);
                for at in 0..ring.len() {
                    self.triangle([ring[at], ring[(at + 1) % ring.len()], middle]);
                }
            }
            for triangle in &disk.triangles {
                self.triangle(triangle.map(id));
            }
        }
    }

    fn corner_values(&self, [i, j, k]: [usize; 3]) -> [f64; 8] {
        std::array::from_fn(|corner| {
            let voxel = [i + (corner & 1), j + (corner >> 1 & 1), k + (corner >> 2)];
            self.field.above(self.field.index(voxel))
        })
    }

    /// Stores a triangle unless voxels at the iso value have merged two of its corners.
    pub fn triangle(&mut self, [a, b, c]: [u32; 3]) {
        if a != b && b != c && c != a {
            self.slab.triangles.push([a, b, c]);
        }
    }
}

/// Which diagonal of a four-sided ring has its middle nearer to the trilinear surface.
fn first_diagonal_fits_better(ring: [u8; 4], values: &[f64; 8]) -> bool {
    let crossings = ring.map(|edge| {
        let [a, b] = edge_corners(edge);
        let (va, vb) = (values[a as usize], values[b as usize]);
        let mut place = [0, 1, 2].map(|axis| f64::from(a >> axis & 1));
        place[usize::from(edge / 4)] = va / (va - vb);
        place
    });
    let misfit = |p: [f64; 3], q: [f64; 3]| {
        let [x, y, z] = [0, 1, 2].map(|axis| 0.5 * (p[axis] + q[axis]));
        let along_x = |at: usize| values[at] + (values[at + 1] - values[at]) * x;
        let along_y = |at: usize| along_x(at) + (along_x(at + 2) - along_x(at)) * y;
        (along_y(0) + (along_y(4) - along_y(0)) * z).abs()
    };
    misfit(crossings[0], crossings[2]) <= misfit(crossings[1], crossings[3])
}

fn bits(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        if word == 0 {
            return None;
        }
        let bit = word.trailing_zeros() as usize;
        word &= word - 1;
        Some(bit)
    })
}
