//! HU on the lattice, with a layer of air around it if the border is closed.

use nalgebra::Vector3;
use ppa_ct::Volume;

/// Least depth below the iso value of the air put around a closed volume, so that a border voxel
/// close to the iso value still gets a lid of its own.
const MIN_LID_HU: f32 = 1.0;

/// Types in which a volume stores HU.
pub trait Sample: Copy + PartialOrd + Sync + Into<f32> {
    /// The least sample that is not below `iso`; `None` when all are below.
    fn first_inside(iso: f32) -> Option<Self>;
}

impl Sample for f32 {
    fn first_inside(iso: f32) -> Option<Self> {
        Some(iso)
    }
}

impl Sample for i16 {
    fn first_inside(iso: f32) -> Option<Self> {
        let least = iso.ceil().max(Self::MIN.into());
        (least <= Self::MAX.into()).then_some(least as Self)
    }
}

/// Values on the (possibly padded) lattice, x fastest.
pub struct Field<'a, T> {
    hu: &'a [T],
    size: [usize; 3],
    iso: f32,
    origin: [f64; 3],
}

impl<'a, T: Sample> Field<'a, T> {
    /// Values of `size` voxels, the first of which is the voxel `origin` of the volume.
    pub fn new(hu: &'a [T], size: [usize; 3], origin: [f64; 3], iso: f32) -> Self {
        Self {
            hu,
            size,
            iso,
            origin,
        }
    }

    /// Smallest and largest value, padding included.
    pub fn range(&self) -> [f32; 2] {
        let widest = |[low, high]: [f32; 2], hu: f32| [low.min(hu), high.max(hu)];
        let values = self.hu.iter().map(|&hu| hu.into());
        values.fold([f32::MAX, f32::MIN], widest)
    }

    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// Voxel index of the first lattice point.
    pub fn origin(&self) -> Vector3<f64> {
        Vector3::from(self.origin)
    }

    /// One row along x.
    pub fn row(&self, j: usize, k: usize) -> &'a [T] {
        let start = self.size[0] * (j + self.size[1] * k);
        &self.hu[start..start + self.size[0]]
    }

    pub fn iso(&self) -> f32 {
        self.iso
    }

    /// HU above iso; exact for the usual HU, so that both cells at a face decide alike.
    pub fn above(&self, [i, j, k]: [usize; 3]) -> f64 {
        let hu: f32 = self.row(j, k)[i].into();
        f64::from(hu) - f64::from(self.iso)
    }

    /// HU above iso at the corners of the cell from a voxel, whose index is `at`.
    #[inline]
    pub fn above_at_corners(&self, at: usize) -> [f32; 8] {
        let [nx, ny, _] = self.size;
        let slice = nx * ny;
        let rows = [at, at + nx, at + slice, at + slice + nx];
        let mut above = [0.0; 8];
        for (pair, row) in above.as_chunks_mut::<2>().0.iter_mut().zip(rows) {
            let ends = &self.hu[row..row + 2];
            pair[0] = ends[0].into() - self.iso;
            pair[1] = ends[1].into() - self.iso;
        }
        above
    }

    /// A row with its four neighbours.
    pub fn stencil(&self, j: usize, k: usize) -> Stencil<'a, T> {
        let [_, ny, nz] = self.size;
        let (south, north) = (j.saturating_sub(1), (j + 1).min(ny - 1));
        let (below, above) = (k.saturating_sub(1), (k + 1).min(nz - 1));
        Stencil {
            here: self.row(j, k),
            beside: [
                [self.row(south, k), self.row(north, k)],
                [self.row(j, below), self.row(j, above)],
            ],
            per_step: [north - south, above - below].map(|steps| 1.0 / steps as f32),
        }
    }
}

fn rise<T: Sample>(low: T, high: T) -> f32 {
    high.into() - low.into()
}

/// A row of the lattice with its neighbours in y and z; at the border, the row itself replaces a missing one.
pub struct Stencil<'a, T> {
    here: &'a [T],
    beside: [[&'a [T]; 2]; 2],
    per_step: [f32; 2],
}

impl<T: Sample> Stencil<'_, T> {
    #[inline]
    pub fn hu(&self, i: usize) -> f32 {
        self.here[i].into()
    }

    /// HU per voxel step: central differences, one-sided at the border.
    #[inline]
    pub fn gradient(&self, i: usize) -> [f32; 3] {
        let (west, east) = (i.saturating_sub(1), (i + 1).min(self.here.len() - 1));
        let along_x = rise(self.here[west], self.here[east]);
        let [[south, north], [below, above]] = self.beside;
        [
            if east - west == 2 {
                0.5 * along_x
            } else {
                along_x
            },
            rise(south[i], north[i]) * self.per_step[0],
            rise(below[i], above[i]) * self.per_step[1],
        ]
    }
}

/// The volume with one more voxel on every side, as far below iso as the nearest voxel is above it:
/// the crossing then lies half-way, on the outer face of the border voxel.
pub fn padded(volume: &Volume, iso: f32) -> Vec<f32> {
    let size = volume.grid().size();
    let outer = size.map(|n| n + 2);
    let nearest = |padded: usize, axis: usize| padded.clamp(1, size[axis]) - 1;
    let lid = |hu: f32| iso - (hu - iso).abs().max(MIN_LID_HU);
    let mut hu = Vec::with_capacity(outer.iter().product());
    for k in 0..outer[2] {
        for j in 0..outer[1] {
            let (row, slice) = (nearest(j, 1), nearest(k, 2));
            let start = volume.grid().index([0, row, slice]);
            let values = volume.values().part(start..start + size[0]);
            let (first, last) = (lid(values.at(0)), lid(values.at(size[0] - 1)));
            hu.push(first);
            if [row + 1, slice + 1] == [j, k] {
                hu.extend(values.iter());
            } else {
                hu.extend(values.iter().map(lid));
            }
            hu.push(last);
        }
    }
    hu
}
