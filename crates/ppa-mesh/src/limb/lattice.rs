//! Neighbourhood and connectivity of voxels.

use nalgebra::Vector3;
use ppa_ct::Grid;

use crate::topology::{join, root};

/// The lattice of a volume with its scan axis.
pub struct Lattice {
    pub size: [usize; 3],
    pub spacing_mm: [f64; 3],
    /// Index axis nearest to the patient's z, along which the couch moves.
    pub scan_axis: usize,
}

/// Connected pieces of a mask.
pub struct Pieces {
    /// Piece of each voxel, `u32::MAX` outside the mask.
    pub labels: Vec<u32>,
    /// Number of pieces.
    pub count: usize,
}

impl Lattice {
    pub fn of(grid: &Grid) -> Self {
        let direction = grid.direction();
        let spacing: Vector3<f64> = grid.spacing_mm();
        Self {
            size: grid.size(),
            spacing_mm: spacing.into(),
            scan_axis: direction.transpose().column(2).iamax(),
        }
    }

    pub fn len(&self) -> usize {
        self.size.iter().product()
    }

    pub fn voxel_mm3(&self) -> f64 {
        self.spacing_mm.iter().product()
    }

    pub fn strides(&self) -> [usize; 3] {
        [1, self.size[0], self.size[0] * self.size[1]]
    }

    pub fn voxel(&self, at: usize) -> [usize; 3] {
        let [nx, ny, _] = self.size;
        [at % nx, at / nx % ny, at / (nx * ny)]
    }

    /// The two axes across the scan axis.
    pub fn across(&self) -> [usize; 2] {
        match self.scan_axis {
            0 => [1, 2],
            1 => [0, 2],
            _ => [0, 1],
        }
    }

    /// Number of the column along the scan axis that a voxel lies in.
    pub fn column(&self, at: usize) -> usize {
        let voxel = self.voxel(at);
        let [u, v] = self.across();
        voxel[u] + self.size[u] * voxel[v]
    }

    /// The up to six voxels that share a face with a voxel.
    pub fn neighbours(&self, at: usize) -> impl Iterator<Item = usize> + use<> {
        let voxel = self.voxel(at);
        let (size, strides) = (self.size, self.strides());
        (0..6).filter_map(move |way| {
            let axis = way / 2;
            if way % 2 == 0 {
                (voxel[axis] > 0).then(|| at - strides[axis])
            } else {
                (voxel[axis] + 1 < size[axis]).then(|| at + strides[axis])
            }
        })
    }

    /// Pieces of a mask connected through faces, numbered by their first voxel.
    pub fn components(&self, mask: &[bool]) -> Pieces {
        let mut parent: Vec<u32> = (0..self.len() as u32).collect();
        let strides = self.strides();
        for k in 0..self.size[2] {
            for j in 0..self.size[1] {
                for i in 0..self.size[0] {
                    let at = i + strides[1] * j + strides[2] * k;
                    if !mask[at] {
                        continue;
                    }
                    for (there, stride) in [(i, strides[0]), (j, strides[1]), (k, strides[2])] {
                        if there > 0 && mask[at - stride] {
                            join(&mut parent, at as u32, (at - stride) as u32);
                        }
                    }
                }
            }
        }
        let mut labels = vec![u32::MAX; mask.len()];
        let mut count = 0;
        for at in (0..mask.len()).filter(|&at| mask[at]) {
            // A root is the smallest index of its piece, so it is labelled first.
            let first = root(&mut parent, at as u32) as usize;
            if first == at {
                labels[at] = count;
                count += 1;
            } else {
                labels[at] = labels[first];
            }
        }
        Pieces {
            labels,
            count: count as usize,
        }
    }

    /// Voxels outside `mask` that no path outside it joins with the border of the lattice.
    pub fn enclosed(&self, mask: &[bool]) -> Vec<bool> {
        let outside: Vec<bool> = mask.iter().map(|m| !m).collect();
        let pieces = self.components(&outside);
        let mut open = vec![false; pieces.count];
        for (at, &label) in pieces.labels.iter().enumerate() {
            let voxel = self.voxel(at);
            let border = (0..3).any(|x| voxel[x] == 0 || voxel[x] + 1 == self.size[x]);
            if border && label != u32::MAX {
                open[label as usize] = true;
            }
        }
        let inner = |&label: &u32| open.get(label as usize).is_some_and(|open| !open);
        pieces.labels.iter().map(inner).collect()
    }
}
