//! HU above the iso value on the lattice, with a layer of air around it when lids are wanted.

use std::borrow::Cow;

use nalgebra::Vector3;
use ppa_ct::{Values, Volume};

/// Least depth below the iso value of the air put around a closed volume, so that a border voxel
/// close to the iso value still gets a lid of its own.
const MIN_LID_HU: f32 = 1.0;

/// Values on the (possibly padded) lattice, x fastest.
pub struct Field<'a> {
    hu: Values<'a>,
    size: [usize; 3],
    iso: f32,
    origin: [f64; 3],
}

impl<'a> Field<'a> {
    /// Values of `size` voxels, the first of which is the voxel `origin` of the volume.
    pub fn new(hu: Values<'a>, size: [usize; 3], origin: [f64; 3], iso: f32) -> Self {
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
        self.hu.iter().fold([f32::MAX, f32::MIN], widest)
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
    pub fn row(&self, j: usize, k: usize) -> Cow<'a, [f32]> {
        let start = self.index([0, j, k]);
        self.hu.part(start..start + self.size[0]).to_f32()
    }

    pub fn iso(&self) -> f32 {
        self.iso
    }

    /// HU above iso; exact for the usual HU, so that both cells at a face decide alike.
    pub fn above(&self, at: usize) -> f64 {
        f64::from(self.hu.at(at)) - f64::from(self.iso)
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
            let rise = f64::from(self.hu.at(at + high)) - f64::from(self.hu.at(at - low));
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
pub fn padded(volume: &Volume, iso: f32) -> Vec<f32> {
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
