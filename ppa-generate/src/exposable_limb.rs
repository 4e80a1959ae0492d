//! A limb before the x-ray device of a plan, and its exposure in a pose.

use std::sync::Arc;

use ppa_mesh::Mesh;
use ppa_scene::{PlaceError, PlaceSettings, Placement};
use ppa_xray::{FastSettings, PreparedPhantom, Projection, Radiograph, Spectrum, TransportError};

use crate::plan::{Plan, XraySettings};
use crate::prepared_limb::PreparedLimb;
use crate::radiograph::{JointError, prepared_phantom, projection};
use crate::scene_setup::{SceneSetupError, Table, spectrum};

/// A limb with all that its exposures share. A clone shares it as well.
#[derive(Clone)]
pub struct ExposableLimb {
    /// Skin, voxels and landmarks.
    pub prepared: Arc<PreparedLimb>,
    /// Room, table and device.
    pub table: Arc<Table>,
    /// The beam.
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
    /// The settings want other voxels than the limb has.
    #[error(
        "half_length_mm, max_voxel_mm, interpolation, form_factors, calibration or engine.compton_model differ from those that the limb's voxels were made with"
    )]
    OtherVoxels,
    /// The beam.
    #[error(transparent)]
    Beam(#[from] SceneSetupError),
}

/// A limb that lies on the table, and the device as its scan sees it.
pub struct PosedExposure<'a> {
    /// The limb.
    pub limb: &'a ExposableLimb,
    /// Where it lies, by the skin of the scan.
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

    /// As [`Self::new`], with the voxels that [`prepared_phantom`] cut out before, for a plan that changes neither them nor their
    /// materials.
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

    /// The same voxels under another tube, beam, detector or engine.
    ///
    /// # Errors
    /// [`ExposureError`] when the settings want other voxels, or their beam cannot be made.
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

    /// Lays a skin of the limb on the table, turned medially by an angle in radians.
    ///
    /// # Errors
    /// [`PlaceError`] when it does not rest there.
    pub fn place(&self, skin: &Mesh, angle_rad: f64) -> Result<Placement, PlaceError> {
        let landmarks = &self.prepared.landmarks;
        (self.table).place(skin, landmarks, angle_rad, &self.place_settings)
    }

    /// The exposure of the limb turned medially by an angle in radians.
    ///
    /// # Errors
    /// [`PlaceError`] when it does not rest on the table.
    pub fn pose(&self, angle_rad: f64) -> Result<PosedExposure<'_>, PlaceError> {
        let placement = self.place(&self.prepared.limb.mesh, angle_rad)?;
        Ok(self.placed(placement))
    }

    /// The exposure of the limb as it lies.
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
    /// As [`PreparedPhantom::histories`].
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

    /// The radiograph by the plan's engine.
    ///
    /// # Errors
    /// [`TransportError`] when geometry, beam or a setting of the engine makes no sense.
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
