//! `plan.toml`: what a dataset is made of.

use std::path::{Path, PathBuf};

use ppa_depth::{RigSpec, SensorSpec};
use ppa_scene::{PlaneSettings, RoomSpec, SoftTissue, Sweep};
use ppa_xray::{Detector, FastSettings, HuCalibration, Presentation, Receptor, Source};
use serde::{Deserialize, Serialize};

use crate::files::{FileError, read_text, write_whole};
use crate::manifest::Rows;
use crate::room_file::RoomFile;
use crate::shaped_skin::ShapeSettings;
use crate::toml_file::{other_version, to_toml};

/// Everything a dataset is made of; unknown keys are refused.
///
/// Relative paths are taken from the folder of the plan file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Format of this file; 1.
    pub version: u32,
    /// Everything random follows from it.
    #[serde(default)]
    pub seed: u64,
    /// The limbs.
    #[serde(rename = "case")]
    pub cases: Vec<PlanCase>,
    /// Medial rotations about the limb's axis (T_rot).
    #[serde(default)]
    pub rotation: Sweep,
    /// Body shapes.
    #[serde(default)]
    pub shapes: ShapeSettings,
    /// How far heel and calf sink in where they rest; a rigid skin when left out.
    #[serde(default)]
    pub soft_tissue: SoftTissue,
    /// The x-ray room.
    #[serde(default)]
    pub room: PlanRoom,
    /// Room, device, detector and cameras from a [`RoomFile`]; reading the plan puts its contents in
    /// place of the path.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub room_file: Option<PathBuf>,
    /// Depth images.
    #[serde(default)]
    pub depth: DepthSettings,
    /// Radiographs.
    #[serde(default)]
    pub xray: XraySettings,
}

/// One limb of a plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanCase {
    /// The case file that `ppa prepare` wrote.
    pub file: PathBuf,
    /// N of the dataset's folder `patient_N`; both limbs of a person share it.
    pub patient: u32,
}

/// The x-ray room: built in, or a recorded one.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlanRoom {
    /// Point cloud of a recorded room, mm. Replaces the built-in furniture.
    pub ply: Option<PathBuf>,
    /// Pose of the x-ray device in a recorded room (row-major 4x4; source at the origin, z along
    /// the beam, y towards the patient's feet). When absent, the recorded frame is that of the
    /// built-in room: z up, y towards the head, origin where the beam meets the table.
    pub room_from_device: Option<Rows>,
    /// The built-in room, and the x-ray device in either room.
    pub parametric: RoomSpec,
    /// How the table plane is searched; when absent, it is what the central beam hits first.
    pub table: Option<PlaneSettings>,
}

/// How depth images are made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DepthSettings {
    /// Camera rig (JSON); the built-in Azure Kinect pair when absent.
    pub rig: Option<PathBuf>,
    /// The camera rig written out, instead of a file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cameras: Option<RigSpec>,
    /// Side of the square region of interest around the joint, mm at the joint.
    pub roi_mm: f64,
    /// Errors of the cameras' sensors; ideal images when absent.
    pub sensor: Option<SensorSpec>,
}

impl Default for DepthSettings {
    fn default() -> Self {
        Self {
            rig: None,
            cameras: None,
            roi_mm: 260.0,
            sensor: None,
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
    /// Focal spot, heel effect and collimation; a point that fills the detector when left out.
    pub source: Source,
    /// Pixels of the image.
    pub detector: Detector,
    /// Anti-scatter grid and converter; none and an ideal one when left out.
    pub receptor: Receptor,
    /// Length of limb kept on either side of the joint, mm.
    pub half_length_mm: f64,
    /// Largest voxel that photons travel through, mm: thicker slices are interpolated, so that
    /// bone edges do not come out as stairs.
    pub max_voxel_mm: f64,
    /// HU to material and density, written out as `[[xray.calibration.segment]]`.
    pub calibration: HuCalibration,
    /// HU to material and density from a file instead; reading the plan puts its contents in place of the path.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration_file: Option<PathBuf>,
    /// The engine.
    pub engine: FastSettings,
    /// The mapping to a radiograph for viewing.
    pub presentation: Presentation,
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
            half_length_mm: 120.0,
            max_voxel_mm: 1.0,
            calibration: HuCalibration::default(),
            calibration_file: None,
            engine: FastSettings::default(),
            presentation: Presentation::default(),
        }
    }
}

/// Farther out or in, a limb is none any more, mm.
const MOST_OFFSET_MM: f64 = 100.0;

/// Bumps of a body shape: without any it would be `orig`, with more they cover the skin.
const BUMPS: std::ops::RangeInclusive<usize> = 1..=100;

/// Why a plan cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// The file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is not a plan.
    #[error("{} is not a plan: {message}", path.display())]
    Parse {
        /// The plan file.
        path: PathBuf,
        /// What is wrong and where.
        message: String,
    },
    /// The file is of another format version.
    #[error("{} has plan version {found}; this program reads version 1", path.display())]
    Version {
        /// The plan file.
        path: PathBuf,
        /// Its version.
        found: u32,
    },
    /// The HU calibration it names.
    #[error(transparent)]
    Calibration(#[from] ppa_xray::CalibrationError),
    /// Its camera rig.
    #[error(transparent)]
    Rig(#[from] ppa_depth::RigError),
    /// Something in it cannot work.
    #[error("{}: {message}", path.display())]
    Invalid {
        /// The plan file.
        path: PathBuf,
        /// What, and what was expected.
        message: String,
    },
}

impl Plan {
    /// A plan with the paper's settings: 0 to 90 degrees in half degrees, all shapes.
    pub fn new(cases: Vec<PlanCase>) -> Self {
        Self {
            version: 1,
            seed: 0,
            cases,
            rotation: Sweep::default(),
            shapes: ShapeSettings::default(),
            soft_tissue: SoftTissue::default(),
            room: PlanRoom::default(),
            room_file: None,
            depth: DepthSettings::default(),
            xray: XraySettings::default(),
        }
    }

    /// Reads a plan and makes its paths relative to the current folder.
    ///
    /// # Errors
    /// [`PlanError`] naming the file and the line, key or value at fault.
    pub fn read(path: &Path) -> Result<Self, PlanError> {
        let text = read_text(path)?;
        if let Some(found) = other_version(&text) {
            let path = path.to_owned();
            return Err(PlanError::Version { path, found });
        }
        let mut plan: Self = toml::from_str(&text).map_err(|error| PlanError::Parse {
            path: path.to_owned(),
            message: error.to_string().trim_end().to_owned(),
        })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        for case in &mut plan.cases {
            case.file = folder.join(&case.file);
        }
        for file in [&mut plan.room.ply, &mut plan.depth.rig]
            .into_iter()
            .flatten()
        {
            *file = folder.join(&*file);
        }
        if let Some(file) = plan.room_file.take() {
            RoomFile::read(&folder.join(file))?
                .put_into(&mut plan)
                .map_err(|message| PlanError::Invalid {
                    path: path.to_owned(),
                    message,
                })?;
        }
        if let Some(file) = plan.xray.calibration_file.take() {
            if plan.xray.calibration != HuCalibration::default() {
                return Err(PlanError::Invalid {
                    path: path.to_owned(),
                    message: "xray.calibration and xray.calibration_file are both given".to_owned(),
                });
            }
            plan.xray.calibration = HuCalibration::read(&folder.join(file))?;
        }
        plan.check().map_err(|message| PlanError::Invalid {
            path: path.to_owned(),
            message,
        })?;
        Ok(plan)
    }

    /// Writes the plan as it stands, whole or not at all.
    ///
    /// # Errors
    /// [`PlanError::File`], also for a path that is not UTF-8, which TOML cannot hold.
    pub fn write(&self, path: &Path) -> Result<(), PlanError> {
        Ok(write_whole(path, to_toml(self, path)?.as_bytes())?)
    }

    /// Whether a dataset can be made of it; says what is wrong.
    pub(crate) fn check(&self) -> Result<(), String> {
        if self.cases.is_empty() {
            return Err("no [[case]]: a plan needs at least one limb".to_owned());
        }
        if self.shapes.variants.is_empty() {
            return Err("shapes.variants is empty: at least \"orig\" is needed".to_owned());
        }
        let mut shapes = self.shapes.variants.clone();
        shapes.sort_unstable();
        shapes.dedup();
        if shapes.len() != self.shapes.variants.len() {
            return Err("shapes.variants names a shape twice".to_owned());
        }
        for (name, value) in [
            ("shapes.offset_mm", self.shapes.offset_mm),
            ("depth.roi_mm", self.depth.roi_mm),
            ("xray.half_length_mm", self.xray.half_length_mm),
            ("xray.max_voxel_mm", self.xray.max_voxel_mm),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(format!("{name} is {value}, expected a length above 0 mm"));
            }
        }
        if self.depth.rig.is_some() && self.depth.cameras.is_some() {
            return Err("depth.rig and depth.cameras are both given".to_owned());
        }
        let offset_mm = self.shapes.offset_mm;
        if offset_mm > MOST_OFFSET_MM {
            return Err(format!(
                "shapes.offset_mm is {offset_mm}, expected at most {MOST_OFFSET_MM} mm"
            ));
        }
        if let Some(bumps) = self.shapes.bumps.iter().find(|n| !BUMPS.contains(n)) {
            return Err(format!(
                "shapes.bumps holds {bumps}, expected {} to {} bumps",
                BUMPS.start(),
                BUMPS.end()
            ));
        }
        if self.xray.engine.seed != 0 {
            return Err("xray.engine.seed is given, but the plan's seed decides".to_owned());
        }
        if self.xray.calibration_file.is_some() {
            return Err("xray.calibration_file is only looked at when a plan is read".to_owned());
        }
        if self.room.ply.is_none() && self.room.room_from_device.is_some() {
            return Err(
                "room.room_from_device is given without room.ply: the built-in room has its device"
                    .to_owned(),
            );
        }
        self.soft_tissue
            .check()
            .map_err(|error| format!("soft_tissue: {error}"))?;
        if let Some(sensor) = &self.depth.sensor {
            sensor
                .check()
                .map_err(|error| format!("depth.sensor: {error}"))?;
        }
        self.rotation
            .poses()
            .map_err(|error| format!("rotation: {error}"))?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use ppa_xray::{Blur, Collimation, DetectorModel, SpotShape};

    use super::*;

    fn read(xray: &str) -> Result<Plan, PlanError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.toml");
        let case = "version = 1\n[[case]]\nfile = \"a.toml\"\npatient = 0\n";
        std::fs::write(&path, format!("{case}{xray}")).unwrap();
        Plan::read(&path)
    }

    /// Source and receptor as a user writes them; what is written by a program reads back the same.
    #[test]
    fn source_and_receptor_are_read_from_the_plan() {
        let plan = read(
            r#"
            [xray.source]
            focal_spot = { size_mm = 0.6, shape = "gaussian" }
            heel_effect = { anode_towards_deg = 90 }
            collimation = { rectangle = { size_mm = [180, 240] } }
            [xray.receptor]
            model = { csi = { thickness_um = 500 } }
            grid = { ratio = 8, lines_per_cm = 40, focus_mm = 1100 }
            blur = { lorentzian = { h_mm2 = 0.45 } }
            electronic_noise_kev = 90
            "#,
        )
        .unwrap();
        let (source, receptor) = (&plan.xray.source, &plan.xray.receptor);
        assert_eq!(source.focal_spot.shape, SpotShape::Gaussian);
        assert!(matches!(
            source.collimation,
            Collimation::Rectangle {
                size_mm: [180.0, 240.0],
                centre_mm: [0.0, 0.0]
            }
        ));
        assert!(matches!(
            receptor.model,
            DetectorModel::Csi { packing: 0.8, .. }
        ));
        assert_eq!(receptor.blur, Some(Blur::Lorentzian { h_mm2: 0.45 }));
        assert_eq!(receptor.grid.as_ref().unwrap().strip, "lead");
        let folder = tempfile::tempdir().unwrap();
        let copy = folder.path().join("copy.toml");
        plan.write(&copy).unwrap();
        let again = Plan::read(&copy).unwrap();
        assert_eq!(
            (&again.xray.source, &again.xray.receptor),
            (source, receptor)
        );
    }

    #[test]
    fn left_out_they_are_a_point_and_an_ideal_detector() {
        let plan = read("").unwrap();
        assert_eq!(plan.xray.source, Source::default());
        assert_eq!(plan.xray.receptor, Receptor::default());
    }

    #[test]
    fn what_cannot_work_is_named() {
        for (more, words) in [
            (
                "[shapes]\nbumps = [1000000000, 3]\n",
                "shapes.bumps holds 1000000000",
            ),
            ("[shapes]\nbumps = [2, 0]\n", "expected 1 to 100 bumps"),
            ("[shapes]\noffset_mm = 101\n", "at most 100 mm"),
            ("[xray.engine]\nseed = 5\n", "xray.engine.seed"),
        ] {
            let error = read(more).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }

    /// Of a newer format more than the version is unknown; the version is what matters.
    #[test]
    fn another_version_is_told_before_its_keys() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.toml");
        std::fs::write(&path, "version = 2\n[holograms]\ncount = 3\n").unwrap();
        let error = Plan::read(&path).unwrap_err();
        assert!(
            matches!(error, PlanError::Version { found: 2, .. }),
            "{error}"
        );
    }

    /// `plans/paper` is the published dataset's size.
    #[test]
    fn the_shipped_plan_has_the_papers_size() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../plans/paper/plan.toml");
        let plan = Plan::read(&path).unwrap();
        let units = plan.cases.len() * plan.rotation.poses().unwrap().len();
        assert_eq!((plan.cases.len(), units), (17, 3077));
        assert_eq!(units * 2 * plan.shapes.variants.len(), 30_770);
        let mut patients: Vec<_> = plan.cases.iter().map(|case| case.patient).collect();
        patients.dedup();
        assert_eq!(patients, (0..17).collect::<Vec<_>>());
    }

    #[test]
    fn unknown_keys_are_named() {
        for (xray, word) in [
            ("[xray.source]\nfocal_spot_mm = 0.6\n", "focal_spot_mm"),
            ("[xray.receptor]\nmodel = \"film\"\n", "film"),
            ("[xray.receptor]\ngrid = { ratio = 8 }\n", "lines_per_cm"),
        ] {
            let error = read(xray).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
