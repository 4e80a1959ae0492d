//! A downsampled scan whose surface follows a slider.

use ppa_ct::{Interpolation, Volume};
use ppa_generate::PreparedLimb;
use ppa_mesh::{Border, Mesh, SurfaceError, iso_surface};

use crate::display_mesh::display_mesh;
use crate::error::StudioError;
use crate::removed::removed;

/// Maximum number of voxels of the coarse scan: its surface takes some tenths of a second.
const MOST_VOXELS: f64 = 4e6;

/// The scan with at most four million voxels.
pub(crate) struct CoarseScan(Volume);

impl CoarseScan {
    /// # Errors
    /// [`StudioError::Volume`] if there is not enough memory.
    pub fn new(scan: &Volume) -> Result<Self, StudioError> {
        let grid = scan.grid();
        let coarser = (grid.len() as f64 / MOST_VOXELS).cbrt();
        Ok(Self(if coarser > 1.0 {
            scan.resampled(grid.spacing_mm() * coarser, Interpolation::Linear)?
        } else {
            scan.clone()
        }))
    }

    /// Returns the surface of everything in the scan at a HU, for display.
    pub fn surface(&self, iso_hu: f32) -> Result<Mesh, StudioError> {
        let surface = iso_surface(&self.0, iso_hu, Border::Open)?;
        Ok(display_mesh(&surface, &[]).0)
    }

    /// Returns the surface of what was removed outside and inside a limb, for display; empty if nothing was removed.
    pub fn removed(&self, limb: &PreparedLimb, iso_hu: f32) -> Result<Mesh, StudioError> {
        let removed = removed(&self.0, &limb.volume, &limb.limb.mask, iso_hu)?;
        match iso_surface(&removed, iso_hu, Border::Open) {
            Ok(surface) => Ok(display_mesh(&surface, &[]).0),
            Err(SurfaceError::Empty { .. }) => Ok(Mesh::default()),
            Err(error) => Err(error.into()),
        }
    }
}
