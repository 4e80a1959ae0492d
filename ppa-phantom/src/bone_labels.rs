//! Bone label of each voxel.

use ppa_ct::Grid;
use rayon::prelude::*;

use super::limb::Limb;

impl Limb {
    /// The names of the bones; label n of [`Limb::bone_labels`] is the nth name, counted from 1.
    pub fn bone_names(&self) -> Vec<&'static str> {
        self.skeleton.bones().iter().map(|bone| bone.name).collect()
    }

    /// Labels the bone at the centre of each voxel of a lattice in the `ct` frame, i fastest; 0 where there is no bone.
    ///
    /// Metal counts as the bone that it is fixed in.
    pub fn bone_labels(&self, grid: &Grid) -> Vec<u8> {
        let mut labels = vec![0; grid.len()];
        let slice = grid.size()[0] * grid.size()[1];
        labels
            .par_chunks_mut(slice)
            .enumerate()
            .for_each(|(k, labels)| {
                for (n, label) in labels.iter_mut().enumerate() {
                    let centre = grid.centre(grid.voxel(k * slice + n).map(|v| v as f64));
                    let bone = self.skeleton.bone_at(&self.limb_point(&centre));
                    *label = bone.map_or(0, |(bone, _)| bone as u8 + 1);
                }
            });
        labels
    }
}
