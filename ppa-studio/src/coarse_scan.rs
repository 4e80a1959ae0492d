//! The scan with fewer voxels, whose surface follows a slider.

use std::sync::{Mutex, PoisonError};

use ppa_ct::{Interpolation, Volume};
use ppa_generate::PreparedLimb;
use ppa_mesh::{Border, Mesh, SurfaceError, iso_surface};

use crate::display_mesh::display_mesh;
use crate::error::StudioError;
use crate::removed::removed;

/// Most voxels of the coarse scan: its surface takes some tenths of a second.
const MOST_VOXELS: f64 = 4e6;

/// The scan with at most four million voxels, made for the first surface.
#[derive(Default)]
pub(crate) struct CoarseScan(Mutex<Option<Volume>>);

impl CoarseScan {
    /// The surface of everything in the scan at a HU, for display.
    pub fn surface(&self, scan: &Volume, iso_hu: f32) -> Result<Mesh, StudioError> {
        let coarse = self.volume(scan)?;
        let surface = iso_surface(&coarse, iso_hu, Border::Open)?;
        Ok(display_mesh(&surface, &[]).0)
    }

    /// The surface of what was removed beside and inside a limb, for display; none where nothing was.
    pub fn removed(&self, limb: &PreparedLimb, iso_hu: f32) -> Result<Mesh, StudioError> {
        let coarse = self.volume(&limb.volume)?;
        let removed = removed(&coarse, &limb.volume, &limb.limb.mask, iso_hu)?;
        match iso_surface(&removed, iso_hu, Border::Open) {
            Ok(surface) => Ok(display_mesh(&surface, &[]).0),
            Err(SurfaceError::Empty { .. }) => Ok(Mesh::default()),
            Err(error) => Err(error.into()),
        }
    }

    fn volume(&self, scan: &Volume) -> Result<Volume, StudioError> {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(coarse) = &*kept {
            return Ok(coarse.clone());
        }
        let grid = scan.grid();
        let coarser = (grid.len() as f64 / MOST_VOXELS).cbrt();
        let coarse = if coarser > 1.0 {
            scan.resampled(grid.spacing_mm() * coarser, Interpolation::Linear)?
        } else {
            scan.clone()
        };
        *kept = Some(coarse.clone());
        Ok(coarse)
    }
}
