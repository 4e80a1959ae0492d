//! Settings of the dose tally.

use ppa_ct::Grid;
use serde::{Deserialize, Serialize};

use crate::dose::voxel_labels::VoxelLabels;
use crate::setters::setters;

/// Doses counted in addition to the energy imparted to every material and to the phantom.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct DoseSettings {
    /// Boxes of voxels, each summed up. They may overlap.
    pub regions: Vec<VoxelBox>,
    /// Labels of the voxels. Voxels with the same label are summed up; label 0 is not counted. A mask has the label 1 where it is set.
    pub labels: Option<VoxelLabels>,
    /// Box whose voxels are counted one by one; 16 bytes per voxel.
    pub voxels: Option<VoxelBox>,
}

/// Voxels `low..high`, half-open on every axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VoxelBox {
    /// First voxel (i, j, k).
    pub low: [usize; 3],
    /// One past the last voxel.
    pub high: [usize; 3],
}

/// Why doses cannot be counted.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DoseError {
    /// A box is empty or extends beyond the phantom.
    #[error(
        "the dose region of voxels ({}, {}, {}) to ({}, {}, {}), exclusive, is empty or extends beyond the phantom of {} x {} x {} voxels",
        low[0], low[1], low[2], high[0], high[1], high[2], size[0], size[1], size[2]
    )]
    Box {
        /// First voxel.
        low: [usize; 3],
        /// One past the last voxel.
        high: [usize; 3],
        /// Voxels of the phantom.
        size: [usize; 3],
    },
    /// The numbers of labels and voxels differ.
    #[error(
        "the dose is requested with {found} labels, expected one for each of {expected} voxels"
    )]
    Labels {
        /// Number of labels.
        found: usize,
        /// Number of voxels.
        expected: usize,
    },
}

setters!(DoseSettings {
    with_regions: regions = Vec<VoxelBox>,
    with_labels: labels = impl Into<Option<VoxelLabels>>,
    with_voxels: voxels = impl Into<Option<VoxelBox>>,
});

impl VoxelBox {
    /// All voxels of a lattice.
    pub fn whole(grid: &Grid) -> Self {
        Self {
            low: [0; 3],
            high: grid.size(),
        }
    }

    /// Voxels along each axis.
    pub fn size(&self) -> [usize; 3] {
        [0, 1, 2].map(|axis| self.high[axis] - self.low[axis])
    }

    /// Number of voxels, or `None` on overflow.
    pub(crate) fn count(&self) -> Option<usize> {
        let [i, j, k] = self.size();
        i.checked_mul(j)?.checked_mul(k)
    }

    /// Index of a voxel in the box, first axis fastest.
    #[inline]
    pub(crate) fn index(&self, voxel: [usize; 3]) -> Option<usize> {
        let inside =
            (0..3).all(|axis| self.low[axis] <= voxel[axis] && voxel[axis] < self.high[axis]);
        let [i, j, k] = [0, 1, 2].map(|axis| voxel[axis].wrapping_sub(self.low[axis]));
        let [ni, nj, _] = self.size();
        inside.then(|| i + ni * (j + nj * k))
    }

    /// The voxels of a box inside `grid`, first axis fastest.
    pub(crate) fn voxels(&self) -> impl Iterator<Item = [usize; 3]> {
        let Self { low, high } = *self;
        (low[2]..high[2]).flat_map(move |k| {
            (low[1]..high[1]).flat_map(move |j| (low[0]..high[0]).map(move |i| [i, j, k]))
        })
    }
}

impl DoseSettings {
    pub(crate) fn validate(&self, grid: &Grid) -> Result<(), DoseError> {
        let size = grid.size();
        for &VoxelBox { low, high } in self.regions.iter().chain(&self.voxels) {
            if (0..3).any(|axis| low[axis] >= high[axis] || high[axis] > size[axis]) {
                return Err(DoseError::Box { low, high, size });
            }
        }
        if let Some(VoxelLabels(labels)) = &self.labels
            && labels.len() != grid.len()
        {
            return Err(DoseError::Labels {
                found: labels.len(),
                expected: grid.len(),
            });
        }
        Ok(())
    }
}
