//! A limb before the x-ray device of a plan, and its exposure in a pose.

use ppa_mesh::Mesh;
use ppa_scene::{PlaceError, Placement};
use ppa_xray::{FastSettings, PreparedPhantom, Projection, Radiograph, Spectrum, TransportError};

use crate::plan::{Plan, XraySettings};
use crate::prepare::PreparedLimb;
use crate::radiograph::{JointError, joint_phantom, projection};
use crate::scene_setup::Table;

/// A limb with all that its exposures share.
pub struct ExposableLimb<'a> {
    /// Skin, voxels and landmarks.
    pub prepared: PreparedLimb,
    /// Room, table and device.
    pub table: &'a Table,
    /// The beam.
    pub spectrum: &'a Spectrum,
    /// The limb around the joint as voxels of material and density, prepared for exposures of all its poses.
    pub phantom: PreparedPhantom<'static>,
    plan: &'a Plan,
}

/// A limb that lies on the table, and the device as its scan sees it.
pub struct PosedExposure<'a> {
    /// The limb.
    pub limb: &'a ExposableLimb<'a>,
    /// Where it lies, by the skin of the scan.
    pub placement: Placement,
    /// Source and detector in the `ct` frame.
    pub projection: Projection,
}

impl<'a> ExposableLimb<'a> {
    /// Cuts the voxels around the joint out of a limb; `table` and `spectrum` are those of `plan`.
    ///
    /// # Errors
    /// [`JointError`] when there is no limb near the joint or the HU calibration is unusable.
    pub fn new(
        prepared: PreparedLimb,
        plan: &'a Plan,
        table: &'a Table,
        spectrum: &'a Spectrum,
    ) -> Result<Self, JointError> {
        let voxels = joint_phantom(&prepared, &plan.xray)?;
        let phantom = PreparedPhantom::new(voxels, plan.xray.engine.compton_model);
        Ok(Self {
            prepared,
            table,
            spectrum,
            phantom,
            plan,
        })
    }

    /// Lays a skin of the limb on the table, turned medially by an angle in radians.
    ///
    /// # Errors
    /// [`PlaceError`] when it does not rest there.
    pub fn place(&self, skin: &Mesh, angle_rad: f64) -> Result<Placement, PlaceError> {
        let (landmarks, soft_tissue) = (&self.prepared.landmarks, &self.plan.soft_tissue);
        self.table.place(skin, landmarks, angle_rad, soft_tissue)
    }

    /// The exposure of the limb turned medially by an angle in radians.
    ///
    /// # Errors
    /// [`PlaceError`] when it does not rest on the table.
    pub fn pose(&'a self, angle_rad: f64) -> Result<PosedExposure<'a>, PlaceError> {
        let placement = self.place(&self.prepared.limb.mesh, angle_rad)?;
        let device = &self.table.room.device;
        Ok(PosedExposure {
            limb: self,
            placement,
            projection: projection(
                &placement,
                &self.prepared.landmarks,
                device,
                self.settings(),
            ),
        })
    }

    /// Settings of its radiographs.
    pub fn settings(&self) -> &'a XraySettings {
        &self.plan.xray
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
