//! `plan.toml`: the settings of a dataset.

mod check;
mod error;
mod marker;
mod room_file;
mod settings;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use ppa_dataset::files::{read_text, write_whole};
use ppa_scene::{PlaceSettings, Positioning, SoftTissue, Sweep};
use ppa_xray::HuCalibration;
use serde::{Deserialize, Serialize};

pub use self::error::PlanError;
pub use self::marker::MarkerPlace;
pub use self::room_file::RoomFile;
pub use self::settings::{DepthSettings, PlanRoom, XraySettings};
use crate::case_names::original_case;
use crate::shaped_skin::ShapeSettings;
use crate::toml_file::{other_version, relative_to, to_toml};

/// Everything that determines a dataset; unknown keys are refused.
///
/// Relative paths are resolved against the folder of the file, or, in memory, against the current folder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Format of this file; 1.
    pub version: u32,
    /// Seed of all random numbers.
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
    /// Indentation of heel and calf where they rest on the table; without it, the skin is rigid.
    #[serde(default)]
    pub soft_tissue: SoftTissue,
    /// Positioning errors: tilt of the limb, and offset of its joint from the central beam.
    #[serde(default)]
    pub positioning: Positioning,
    /// The x-ray room.
    #[serde(default)]
    pub room: PlanRoom,
    /// File with room, device, detector and cameras, see [`RoomFile`]; its contents replace the path when the plan is read.
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
            positioning: Positioning::default(),
            room: PlanRoom::default(),
            room_file: None,
            depth: DepthSettings::default(),
            xray: XraySettings::default(),
        }
    }

    /// How limbs lie on the table, apart from their rotation.
    pub fn place_settings(&self) -> PlaceSettings {
        PlaceSettings {
            soft_tissue: self.soft_tissue,
            positioning: self.positioning,
        }
    }

    /// Whether [`prepared_phantom`](crate::prepared_phantom) gives the same voxels for both.
    pub fn same_voxels(&self, other: &Self) -> bool {
        let [_, along_mm] = self.positioning.beam_shift_mm;
        along_mm == other.positioning.beam_shift_mm[1] && self.xray.same_voxels(&other.xray)
    }

    /// Returns the patient of a case file, or of the file with its changes; `None` if the plan does not name it.
    pub fn patient_of(&self, case_file: &Path) -> Option<u32> {
        let original = |file: &Path| {
            let file = original_case(file).unwrap_or_else(|| file.to_owned());
            file.canonicalize().unwrap_or(file)
        };
        let wanted = original(case_file);
        let mut cases = self.cases.iter();
        let planned = cases.find(|planned| original(&planned.file) == wanted)?;
        Some(planned.patient)
    }

    /// Reads a plan and makes its paths relative to the current folder.
    ///
    /// # Errors
    /// [`PlanError`] naming the file and the line, key or value at fault.
    pub fn read(path: &Path) -> Result<Self, PlanError> {
        Self::of_text(&read_text(path)?, path)
    }

    /// Parses the text of a plan; `path` is its file, which need not exist yet.
    ///
    /// # Errors
    /// The same as [`Plan::read`].
    pub fn of_text(text: &str, path: &Path) -> Result<Self, PlanError> {
        if let Some(found) = other_version(text) {
            let path = path.to_owned();
            return Err(PlanError::Version { path, found });
        }
        let mut plan: Self = toml::from_str(text).map_err(|error| PlanError::Parse {
            path: path.to_owned(),
            message: error.to_string().trim_end().to_owned(),
        })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        for file in plan.files_mut() {
            *file = folder.join(&*file);
        }
        if let Some(file) = plan.room_file.take() {
            RoomFile::read(&file)?
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
            plan.xray.calibration = HuCalibration::read(&file)?;
        }
        plan.check().map_err(|message| PlanError::Invalid {
            path: path.to_owned(),
            message,
        })?;
        Ok(plan)
    }

    /// Writes the plan, whole or not at all. Relative paths are rewritten to start at the plan file's folder.
    ///
    /// # Errors
    /// [`PlanError::File`], also for a path that is not UTF-8, which TOML cannot hold.
    pub fn write(&self, path: &Path) -> Result<(), PlanError> {
        let mut plan = self.clone();
        let folder = path.parent().unwrap_or(Path::new(""));
        for file in plan.files_mut() {
            *file = relative_to(file, folder)?;
        }
        Ok(write_whole(path, to_toml(&plan, path)?.as_bytes())?)
    }

    /// The files that the plan names.
    pub(crate) fn files_mut(&mut self) -> impl Iterator<Item = &mut PathBuf> {
        let cases = self.cases.iter_mut().map(|case| &mut case.file);
        let others = [
            &mut self.room_file,
            &mut self.room.ply,
            &mut self.depth.rig,
            &mut self.xray.calibration_file,
        ];
        cases.chain(others.into_iter().flatten())
    }
}
