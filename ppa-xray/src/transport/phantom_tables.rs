//! What transport needs of a phantom, whatever the exposure is.

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use rayon::prelude::*;

use crate::matter::compton::ComptonModel;
use crate::matter::sampler::MaterialTables;
use crate::phantom::voxels::{VoxelPhantom, voxel_mm3};
use crate::transport::attenuation::Attenuation;
use crate::transport::majorants::Majorants;
use crate::transport::voxel_codes::{VoxelCode, voxel_codes};

/// A phantom with the tables of its materials and voxels.
pub(crate) struct PhantomTables<'a> {
    pub phantom: Arc<Cow<'a, VoxelPhantom>>,
    pub attenuation: Attenuation,
    pub samplers: Vec<MaterialTables>,
    pub codes: Vec<VoxelCode>,
    majorants: OnceLock<Majorants>,
}

impl<'a> PhantomTables<'a> {
    pub fn new(phantom: Arc<Cow<'a, VoxelPhantom>>, compton_model: ComptonModel) -> Self {
        let samplers: Vec<_> = phantom
            .materials()
            .par_iter()
            .map(|material| MaterialTables::new(material, compton_model))
            .collect();
        Self {
            attenuation: Attenuation::new(&samplers),
            samplers,
            codes: voxel_codes(&phantom),
            majorants: OnceLock::new(),
            phantom,
        }
    }

    /// Bounds for Woodcock tracking. The fast engine never asks for them.
    pub fn majorants(&self) -> &Majorants {
        self.majorants.get_or_init(|| {
            let grid = self.phantom.grid();
            let voxel_mm = voxel_mm3(grid).cbrt();
            Majorants::new(&self.codes, grid.size(), voxel_mm, &self.attenuation)
        })
    }

    #[cfg(test)]
    pub fn set_majorants(&mut self, majorants: Majorants) {
        self.majorants = majorants.into();
    }
}
