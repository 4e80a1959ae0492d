//! A view of a volume in the order of the body's axes, without a copy.

use crate::volume::Volume;

/// Voxels indexed by steps towards the left, posterior and superior, along the volume's axes closest to
/// these directions; nothing is interpolated.
pub struct LpsView<'a> {
    volume: &'a Volume,
    axes: [(usize, bool); 3],
}

impl<'a> LpsView<'a> {
    /// The view of a volume.
    pub fn of(volume: &'a Volume) -> Self {
        Self {
            volume,
            axes: volume.grid().lps_axes(),
        }
    }

    /// Numbers of voxels towards the left, posterior and superior.
    pub fn size(&self) -> [usize; 3] {
        self.axes.map(|(axis, _)| self.volume.grid().size()[axis])
    }

    /// Distances between neighbours along these directions.
    pub fn spacing_mm(&self) -> [f64; 3] {
        let spacing = self.volume.grid().spacing_mm();
        self.axes.map(|(axis, _)| spacing[axis])
    }

    /// HU of the voxel at an index counted from the right, anterior and inferior end.
    ///
    /// # Panics
    /// If the index is outside [`size`](Self::size).
    pub fn at(&self, place: [usize; 3]) -> f32 {
        let mut voxel = [0; 3];
        for ((axis, turned), at) in self.axes.into_iter().zip(place) {
            let last = self.volume.grid().size()[axis] - 1;
            voxel[axis] = if turned { last - at } else { at };
        }
        self.volume.at(voxel)
    }
}
