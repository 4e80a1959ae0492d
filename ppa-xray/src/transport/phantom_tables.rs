//! Tables of a phantom that the transport needs for any exposure.

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use nalgebra::Vector3;
use ppa_core::random::Philox;
use rayon::prelude::*;

use crate::matter::compton::ComptonModel;
use crate::matter::sampler::MaterialTables;
use crate::phantom::interpolation::Interpolation;
use crate::phantom::voxels::{VoxelPhantom, voxel_mm3};
use crate::transport::attenuation::Attenuation;
use crate::transport::majorants::Majorants;
use crate::transport::voxel_codes::{VoxelCode, VoxelCodes};

/// A phantom with the tables of its materials and voxels.
pub(crate) struct PhantomTables<'a> {
    pub phantom: Arc<Cow<'a, VoxelPhantom>>,
    pub attenuation: Attenuation,
    pub samplers: Vec<MaterialTables>,
    pub codes: VoxelCodes,
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
            codes: VoxelCodes::new(&phantom),
            majorants: OnceLock::new(),
            phantom,
        }
    }

    /// Bounds for Woodcock tracking. Call this once before threads follow histories; otherwise each thread computes them.
    pub fn majorants(&self) -> &Majorants {
        if let Some(majorants) = self.majorants.get() {
            return majorants;
        }
        // Computed before the cell is locked: a thread that waits for others meanwhile may be given histories that need the cell.
        let voxel_mm = voxel_mm3(self.phantom.grid()).cbrt();
        let halo = self.phantom.interpolation().halo();
        let majorants = Majorants::new(&self.codes, halo, voxel_mm, &self.attenuation);
        self.majorants.get_or_init(|| majorants)
    }

    /// Samples material and density at a point in the box, in cells from its corner.
    ///
    /// Trilinear interpolation is the mean of the voxels at this point plus an offset that is uniform over one voxel. So one of the eight
    /// neighbours, chosen with the probability of its weight, represents the density of all materials there.
    #[inline]
    pub fn draw_code(&self, cell: &Vector3<f64>, rng: &mut Philox) -> VoxelCode {
        let corner = match self.phantom.interpolation() {
            Interpolation::Nearest => Vector3::repeat(1.0),
            Interpolation::Trilinear => Vector3::from_fn(|_, _| rng.unit() + 0.5),
        };
        let size = self.codes.size();
        let at = [0, 1, 2].map(|axis| ((cell[axis] + corner[axis]) as usize).min(size[axis] - 1));
        self.codes.all()[self.codes.index(at)]
    }

    #[cfg(test)]
    pub fn set_majorants(&mut self, majorants: Majorants) {
        self.majorants = majorants.into();
    }
}
