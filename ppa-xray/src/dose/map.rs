//! Absorbed dose of every voxel as a volume.

use ppa_ct::{Grid, Volume, VolumeError};

use crate::dose::report::Dose;

/// Why a volume of absorbed doses is not available.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DoseMapError {
    /// Doses are known only per history.
    #[error("the fluence of the spectrum is unknown")]
    Fluence,
    /// No voxel doses were requested.
    #[error("no voxel doses were counted")]
    Voxels,
    /// The grid does not match that of the voxels.
    #[error(transparent)]
    Volume(#[from] VolumeError),
}

impl Dose {
    /// Absorbed dose in every voxel of the phantom, whose grid is `grid`, in µGy per mAs.
    ///
    /// # Errors
    /// [`DoseMapError`] if the doses of all voxels were not counted or cannot be scaled to mAs.
    pub fn map_ugy_per_mas(&self, grid: &Grid) -> Result<Volume, DoseMapError> {
        let per_mas = self.histories_per_mas.ok_or(DoseMapError::Fluence)?;
        let voxels = self.voxels.as_ref().ok_or(DoseMapError::Voxels)?;
        let gray = voxels.gy_per_history();
        let micro = gray
            .iter()
            .map(|&gray| (1e6 * per_mas * f64::from(gray)) as f32);
        Ok(Volume::new(grid.clone(), micro.collect())?)
    }
}
