//! A limb with the x-ray device of a plan, and its exposure in a pose.

use std::sync::Arc;

use ppa_mesh::Mesh;
use ppa_scene::{PlaceError, PlaceSettings, Placement};
use ppa_xray::{FastSettings, PreparedPhantom, Projection, Radiograph, Spectrum, TransportError};

use crate::plan::{Plan, XraySettings};
use crate::prepared_limb::PreparedLimb;
use crate::radiograph::{JointError, prepared_phantom, projection};
use crate::scene_setup::{SceneSetupError, Table, spectrum};

/// A limb with the data that all its exposures and clones share.
#[derive(Clone)]
pub struct ExposableLimb {
    /// Skin, voxels and landmarks.
    pub prepared: Arc<PreparedLimb>,
    /// Room, table and device.
    pub table: Arc<Table>,
    /// The x-ray beam.
    pub spectrum: Arc<Spectrum>,
    /// The limb around the central beam as voxels of material and density, prepared for exposures of all its poses.
    pub phantom: Arc<PreparedPhantom<'static>>,
    place_settings: PlaceSettings,
    xray: Arc<XraySettings>,
}

/// Why a limb cannot be exposed with other settings.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExposureError {
    /// The settings require other voxels than the limb has.
    #[error(
        "half_length_mm, max_voxel_mm, interpolation, form_factors, calibration or engine.compton_model differ from those that the limb's voxels were made with"
    )]
    OtherVoxels,
    /// The x-ray beam.
    #[error(transparent)]
    Beam(#[from] SceneSetupError),
}

/// A limb on the table, and the device in the frame of its scan.
pub struct PosedExposure<'a> {
    /// The limb.
    pub limb: &'a ExposableLimb,
    /// Placement of the limb, from the skin of the scan.
    pub placement: Placement,
    /// Source and detector in the `ct` frame.
    pub projection: Projection,
}

impl ExposableLimb {
    /// Cuts the voxels around the central beam out of a limb; `table` and `spectrum` are those of `plan`.
    ///
    /// # Errors
    /// [`JointError`] when there is no limb near the beam or the HU calibration is unusable.
    pub fn new(
        prepared: impl Into<Arc<PreparedLimb>>,
        plan: &Plan,
        table: Arc<Table>,
        spectrum: Arc<Spectrum>,
    ) -> Result<Self, JointError> {
        let prepared = prepared.into();
        let phantom = Arc::new(prepared_phantom(&prepared, plan)?);
        Ok(Self::with_phantom(prepared, phantom, plan, table, spectrum))
    }

    /// Like [`Self::new`], with voxels that [`prepared_phantom`] cut out before, for a plan that changes neither them nor their materials.
    pub fn with_phantom(
        prepared: Arc<PreparedLimb>,
        phantom: Arc<PreparedPhantom<'static>>,
        plan: &Plan,
        table: Arc<Table>,
        spectrum: Arc<Spectrum>,
    ) -> Self {
        Self {
            prepared,
            table,
            spectrum,
            phantom,
            place_settings: plan.place_settings(),
            xray: Arc::new(plan.xray.clone()),
        }
    }

    /// Returns the same voxels with another tube, beam, detector or engine.
    ///
    /// # Errors
    /// [`ExposureError`] if the settings require other voxels, or their beam cannot be computed.
    pub fn exposed_by(&self, xray: XraySettings) -> Result<Self, ExposureError> {
        if !xray.same_voxels(&self.xray) {
            return Err(ExposureError::OtherVoxels);
        }
        let beam = |settings: &XraySettings| {
            let (kvp, anode_angle_deg) = (settings.kvp, settings.anode_angle_deg);
            (kvp, anode_angle_deg, settings.filters.clone())
        };
        let spectrum = if beam(&xray) == beam(&self.xray) {
            self.spectrum.clone()
        } else {
            Arc::new(spectrum(&xray)?)
        };
        Ok(Self {
            spectrum,
            xray: Arc::new(xray),
            ..self.clone()
        })
    }

    /// Lays a skin of the limb on the table, rotated medially by an angle in radians.
    ///
    /// # Errors
    /// [`PlaceError`] when it does not rest there.
    pub fn place(&self, skin: &Mesh, angle_rad: f64) -> Result<Placement, PlaceError> {
        let landmarks = &self.prepared.landmarks;
        (self.table).place(skin, landmarks, angle_rad, &self.place_settings)
    }

    /// The exposure of the limb rotated medially by an angle in radians.
    ///
    /// # Errors
    /// [`PlaceError`] when it does not rest on the table.
    pub fn pose(&self, angle_rad: f64) -> Result<PosedExposure<'_>, PlaceError> {
        let placement = self.place(&self.prepared.limb.mesh, angle_rad)?;
        Ok(self.placed(placement))
    }

    /// The exposure of the placed limb.
    pub fn placed(&self, placement: Placement) -> PosedExposure<'_> {
        let device = &self.table.room.device;
        PosedExposure {
            limb: self,
            placement,
            projection: projection(
                &placement,
                &self.prepared.landmarks,
                device,
                self.settings(),
            ),
        }
    }

    /// Settings of its radiographs.
    pub fn settings(&self) -> &XraySettings {
        &self.xray
    }
}

impl PosedExposure<'_> {
    /// The settings with the histories of the plan's tube load, if it has one.
    ///
    /// # Errors
    /// The same as [`PreparedPhantom::histories`].
    pub fn fast_settings(&self, settings: FastSettings) -> Result<FastSettings, TransportError> {
        let ExposableLimb {
            phantom, spectrum, ..
        } = self.limb;
        let Some(load) = self.limb.settings().tube_load else {
            return Ok(settings);
        };
        let dose_histories = phantom.histories(load, spectrum, &self.projection, &settings)?;
        Ok(settings.with_dose_histories(dose_histories))
    }

    /// Computes the radiograph with the plan's engine.
    ///
    /// # Errors
    /// [`TransportError`] if geometry, beam or a setting of the engine is invalid.
    pub fn radiograph(&self, seed: u64) -> Result<Radiograph, TransportError> {
        let ExposableLimb {
            phantom, spectrum, ..
        } = self.limb;
        let XraySettings { engine, analog, .. } = self.limb.settings();
        match *analog {
            Some(settings) => {
                let settings = settings.with_seed(seed);
                ppa_xray::analog(phantom.phantom(), spectrum, &self.projection, &settings)
            }
            None => {
                let settings = self.fast_settings(engine.with_seed(seed))?;
                phantom.fast(spectrum, &self.projection, &settings)
            }
        }
    }
}
