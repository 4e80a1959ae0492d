//! A phantom with the tables shared by all its fast exposures.

use std::borrow::Cow;
use std::sync::Arc;

use rayon::prelude::*;

use crate::engine::path_tables::PathTables;
use crate::matter::compton::ComptonModel;
use crate::matter::scatter_density::ScatterDensities;
use crate::phantom::voxels::VoxelPhantom;
use crate::transport::phantom_tables::PhantomTables;
use crate::transport::tracking::TransportError;

/// A phantom with the tables shared by all its fast exposures, for any pose, beam and detector.
///
/// For a hundred million voxels they take 2 CPU seconds and 400 MB.
pub struct PreparedPhantom<'a> {
    phantom: Arc<Cow<'a, VoxelPhantom>>,
    compton_model: ComptonModel,
    tables: FastTables<'a>,
}

/// Data of a phantom that the fast engine needs.
pub(super) struct FastTables<'a> {
    pub transport: Arc<PhantomTables<'a>>,
    pub paths: PathTables,
    /// By material.
    pub densities: Vec<ScatterDensities>,
}

impl<'a> From<VoxelPhantom> for Cow<'a, VoxelPhantom> {
    fn from(phantom: VoxelPhantom) -> Self {
        Cow::Owned(phantom)
    }
}

impl<'a> From<&'a VoxelPhantom> for Cow<'a, VoxelPhantom> {
    fn from(phantom: &'a VoxelPhantom) -> Self {
        Cow::Borrowed(phantom)
    }
}

impl<'a> PreparedPhantom<'a> {
    /// Prepares a phantom, borrowed or owned, for exposures with `compton_model`.
    pub fn new(phantom: impl Into<Cow<'a, VoxelPhantom>>, compton_model: ComptonModel) -> Self {
        let phantom = Arc::new(phantom.into());
        let transport = PhantomTables::new(phantom.clone(), compton_model);
        transport.majorants();
        let materials = phantom.materials().par_iter();
        let tables = FastTables {
            paths: PathTables::new(&transport),
            densities: materials
                .map(|material| ScatterDensities::new(material, compton_model))
                .collect(),
            transport: Arc::new(transport),
        };
        Self {
            phantom,
            compton_model,
            tables,
        }
    }

    /// The phantom itself.
    pub fn phantom(&self) -> &VoxelPhantom {
        &self.phantom
    }

    pub(super) fn tables(&self) -> &FastTables<'a> {
        &self.tables
    }

    /// # Errors
    /// [`TransportError::ComptonModel`] if the phantom was prepared for another model than `found`.
    pub(super) fn check_model(&self, found: ComptonModel) -> Result<(), TransportError> {
        if found == self.compton_model {
            return Ok(());
        }
        Err(TransportError::ComptonModel {
            found,
            prepared: self.compton_model,
        })
    }
}
