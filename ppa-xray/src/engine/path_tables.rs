//! Tables of a phantom for paths of any exposure: basis materials, coarse cells, uniform blocks.

use std::sync::Arc;

use crate::engine::attenuation_basis::AttenuationBasis;
use crate::engine::coarse_cells::CoarseCells;
use crate::engine::uniform_blocks::UniformBlocks;
use crate::transport::phantom_tables::PhantomTables;

/// Number of cells of the coarse lattice: 2 MB, which fits into the second-level cache of a core.
const COARSE_CELLS: usize = 128 * 1024;

/// Tables shared by all exposures of a phantom.
#[derive(Clone)]
pub(crate) struct PathTables {
    pub(super) basis: Arc<AttenuationBasis>,
    pub(super) coarse: Arc<CoarseCells>,
    pub(super) blocks: Arc<UniformBlocks>,
}

impl PathTables {
    pub fn new(tables: &PhantomTables) -> Self {
        Self::with_coarse_cells(tables, COARSE_CELLS)
    }

    /// The same as [`PathTables::new`], with at most `cells` coarse cells.
    pub fn with_coarse_cells(tables: &PhantomTables, cells: usize) -> Self {
        let phantom = &*tables.phantom;
        let basis = AttenuationBasis::new(&tables.attenuation, phantom.materials().len());
        Self {
            coarse: Arc::new(CoarseCells::new(phantom, &basis, cells)),
            blocks: Arc::new(UniformBlocks::new(
                &tables.codes,
                phantom.interpolation().halo(),
            )),
            basis: Arc::new(basis),
        }
    }
}
