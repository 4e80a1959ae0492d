//! Room, depth images and radiographs of a plan.

use std::path::PathBuf;

use ppa_core::TransformRows;
use ppa_depth::{RigSpec, SensorSpec, WallDepth};
use ppa_scene::{PlaneSettings, RoomSpec};
use ppa_xray::{
    AnalogSettings, Detector, FastSettings, FormFactors, HuCalibration, Interpolation,
    Presentation, Receptor, Source, SpectrumError, TubeLoad, TubeSpec,
};
use serde::{Deserialize, Serialize};

use crate::cut_error::MAX_CUT_SHARE;
use crate::plan::marker::MarkerPlace;

/// The x-ray room: built in, or a recorded one.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlanRoom {
    /// Point cloud of a recorded room, mm. Replaces the built-in furniture.
    pub ply: Option<PathBuf>,
    /// Pose of the x-ray device in a recorded room (row-major 4x4; source at the origin, z along
    /// the beam, y towards the patient's feet). When absent, the recorded frame is that of the
    /// built-in room: z up, y towards the head, origin where the beam meets the table.
    pub room_from_device: Option<TransformRows>,
    /// The built-in room, and the x-ray device in either room.
    pub parametric: RoomSpec,
    /// How the table plane is searched for; when absent, it is the surface that the central beam hits first.
    pub table: Option<PlaneSettings>,
}

/// How depth images are made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DepthSettings {
    /// Camera rig (JSON); the built-in Azure Kinect pair when absent.
    pub rig: Option<PathBuf>,
    /// The camera rig itself, instead of a file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cameras: Option<RigSpec>,
    /// Side of the square region of interest around the joint, mm at the joint.
    pub roi_mm: f64,
    /// Errors of the cameras' sensors; ideal images when absent.
    pub sensor: Option<SensorSpec>,
    /// Depth where the field of view of the scan cuts the limb off: none (`invalid`), or that of a flat wall (`flat`).
    pub cut_faces: WallDepth,
    /// Largest share of a region of interest, 0 to 1, that may show a cut of the limb, measured on the skin of the scan; a limb that
    /// exceeds it in any pose is refused.
    pub max_cut_share: f64,
}

impl Default for DepthSettings {
    fn default() -> Self {
        Self {
            rig: None,
            cameras: None,
            roi_mm: 260.0,
            sensor: None,
            cut_faces: WallDepth::default(),
            max_cut_share: MAX_CUT_SHARE,
        }
    }
}

impl DepthSettings {
    /// The camera rig.
    ///
    /// # Errors
    /// [`RigError`](ppa_depth::RigError) when it is a file that cannot be read.
    pub fn cameras(&self) -> Result<RigSpec, ppa_depth::RigError> {
        match (&self.cameras, &self.rig) {
            (Some(cameras), _) => Ok(cameras.clone()),
            (None, Some(path)) => RigSpec::read(path),
            (None, None) => Ok(RigSpec::default()),
        }
    }
}

/// How radiographs are made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct XraySettings {
    /// Tube voltage in kV.
    pub kvp: f64,
    /// Angle of the tungsten anode in degrees.
    pub anode_angle_deg: f64,
    /// Filters as `MATERIAL:mm`.
    pub filters: Vec<String>,
    /// Focal spot, heel effect and collimation; without it, a point source collimated to the detector.
    pub source: Source,
    /// Pixels of the image.
    pub detector: Detector,
    /// Anti-scatter grid and converter; no grid and an ideal converter when left out.
    pub receptor: Receptor,
    /// The letter L or R on the detector; none when left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub marker: Option<MarkerPlace>,
    /// Length of limb kept along its axis on either side of the joint, or of the central beam if that is shifted, mm.
    pub half_length_mm: f64,
    /// Largest voxel size in photon transport, mm: thicker slices are interpolated, so that bone edges show no steps.
    pub max_voxel_mm: f64,
    /// Interpolation of density between the centres of these voxels.
    pub interpolation: Interpolation,
    /// Form factors of Rayleigh scattering.
    pub form_factors: FormFactors,
    /// HU to material and density, written out as `[[xray.calibration.segment]]`.
    pub calibration: HuCalibration,
    /// HU to material and density from a file instead; its contents replace the path when the plan is read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration_file: Option<PathBuf>,
    /// Tube load of a radiograph, which replaces the histories of `engine`: mAs, or an exposure index for automatic exposure control.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tube_load: Option<TubeLoad>,
    /// The fast engine.
    pub engine: FastSettings,
    /// Analog Monte Carlo in place of the fast engine, which is used when this is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub analog: Option<AnalogSettings>,
    /// The mapping to a radiograph for viewing.
    pub presentation: Presentation,
    /// Largest share of the rays around the joint, 0 to 1, that may enter or leave the scan where its field of view cuts off the limb; a
    /// limb that exceeds it in any pose is refused.
    #[serde(skip_serializing_if = "is_default_share")]
    pub max_cut_share: f64,
}

impl Default for XraySettings {
    fn default() -> Self {
        Self {
            kvp: 60.0,
            anode_angle_deg: 12.0,
            filters: vec!["Al:2.5".to_owned()],
            source: Source::default(),
            detector: Detector::centred(448, 448, 0.5),
            receptor: Receptor::default(),
            marker: None,
            half_length_mm: 120.0,
            max_voxel_mm: 1.0,
            interpolation: Interpolation::Trilinear,
            form_factors: FormFactors::default(),
            calibration: HuCalibration::default(),
            calibration_file: None,
            tube_load: None,
            engine: FastSettings::default(),
            analog: None,
            presentation: Presentation::default(),
            max_cut_share: MAX_CUT_SHARE,
        }
    }
}

impl XraySettings {
    /// The tube and its filters.
    ///
    /// # Errors
    /// [`SpectrumError`] for a filter that cannot be read.
    pub(crate) fn tube(&self) -> Result<TubeSpec, SpectrumError> {
        let filters = self.filters.iter().map(|filter| filter.parse());
        Ok(TubeSpec::new(
            self.kvp,
            self.anode_angle_deg,
            filters.collect::<Result<_, SpectrumError>>()?,
        ))
    }

    /// Whether both settings give a limb the same voxels.
    pub(crate) fn same_voxels(&self, other: &Self) -> bool {
        self.half_length_mm == other.half_length_mm
            && self.max_voxel_mm == other.max_voxel_mm
            && self.interpolation == other.interpolation
            && self.form_factors == other.form_factors
            && self.calibration == other.calibration
            && self.engine.compton_model == other.engine.compton_model
    }
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde calls it with a reference"
)]
fn is_default_share(share: &f64) -> bool {
    *share == MAX_CUT_SHARE
}
