//! HU above the iso value on the lattice, with a layer of air around it when lids are wanted.

use std::borrow::Cow;

use nalgebra::Vector3;
use ppa_ct::Volume;

use super::Border;

/// Least depth below the iso value of the air put around a closed volume, so that a border voxel
/// close to the iso value still gets a lid of its own.
const MIN_LID_HU: f32 = 1.0;

/// Values on the (possibly padded) lattice, x fastest.
pub struct Field<'a> {
    hu: Cow<'a, [f32]>,
    size: [usize; 3],
    iso: f32,
    origin: [f64; 3],
}

impl<'a> Field<'a> {
    pub fn new(volume: &'a Volume, iso: f32, border: Border) -> Self {
        let size = volume.grid().size();
        match border {
            Border::Open => Self {
                hu: Cow::Borrowed(volume.hu()),
                size,
                iso,
                origin: [0.0; 3],
            },
            Border::Closed => Self {
                hu: Cow::Owned(padded(volume, iso)),
                size: size.map(|n| n + 2),
                iso,
                origin: [-1.0; 3],
            },
        }
    }

    /// Values of a box of a volume whose first voxel is `low`.
    pub fn part(hu: Vec<f32>, low: [usize; 3], size: [usize; 3], iso: f32) -> Self {
        Self {
            hu: Cow::Owned(hu),
            size,
            iso,
            origin: low.map(|first| first as f64),
        }
    }

    /// All values, padding included.
    pub fn values(&self) -> &[f32] {
        &self.hu
    }

    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// Voxel index of the first lattice point.
    pub fn origin(&self) -> Vector3<f64> {
        Vector3::from(self.origin)
    }

    pub fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.size[0] * (j + self.size[1] * k)
    }

    /// One row along x.
    pub fn row(&self, j: usize, k: usize) -> &[f32] {
        let start = self.index([0, j, k]);
        &self.hu[start..start + self.size[0]]
    }

    pub fn iso(&self) -> f32 {
        self.iso
    }

    /// HU above iso; exact for the usual HU, so that both cells at a face decide alike.
    pub fn above(&self, at: usize) -> f64 {
        f64::from(self.hu[at]) - f64::from(self.iso)
    }

    /// HU per voxel step: central differences, one-sided at the border.
    pub fn gradient(&self, voxel: [usize; 3]) -> Vector3<f64> {
        let at = self.index(voxel);
        let strides = [1, self.size[0], self.size[0] * self.size[1]];
        Vector3::from_fn(|axis, _| {
            let (low, high) = (
                if voxel[axis] > 0 { strides[axis] } else { 0 },
                if voxel[axis] + 1 < self.size[axis] {
                    strides[axis]
                } else {
                    0
                },
            );
            let rise = f64::from(self.hu[at + high]) - f64::from(self.hu[at - low]);
            if low > 0 && high > 0 {
                0.5 * rise
            } else {
                rise
            }
        })
    }
}

/// The volume with one more voxel on every side, as far below iso as the nearest voxel is above it:
/// the crossing then lies half-way, on the outer face of the border voxel.
fn padded(volume: &Volume, iso: f32) -> Vec<f32> {
    let size = volume.grid().size();
    let outer = size.map(|n| n + 2);
    let mut hu = Vec::with_capacity(outer.iter().product());
    for k in 0..outer[2] {
        for j in 0..outer[1] {
            for i in 0..outer[0] {
                let padded = [i, j, k];
                let nearest = [0, 1, 2].map(|a| padded[a].clamp(1, size[a]) - 1);
                let value = volume.at(nearest);
                hu.push(if nearest.map(|v| v + 1) == padded {
                    value
                } else {
                    iso - (value - iso).abs().max(MIN_LID_HU)
                });
            }
        }
    }
    hu
}
