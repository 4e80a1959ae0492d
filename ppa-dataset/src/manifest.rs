//! The manifest: `manifest.jsonl` with one row per image, `dataset.json` with the settings common to all.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use ppa_core::TransformRows;
use serde::{Deserialize, Serialize};

use crate::archive::require_folder;
use crate::body_shape::BodyShape;
use crate::files::{FileError, read_text};
use crate::layout::{LimbId, View};

/// File with the settings, cameras and program common to all images of a dataset.
pub const DESCRIPTION_FILE: &str = "dataset.json";

/// Kind of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FileKind {
    /// 16-bit PNG, Z in mm, 0 invalid.
    Depth,
    /// 16-bit PNG for viewing.
    Radiograph,
    /// OpenEXR with the tallies, eV/cm² per history.
    RadiographTallies,
}

/// One image of the dataset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FileRow {
    /// Path from the dataset's root.
    pub file: String,
    /// SHA-256 of its bytes.
    pub sha256: String,
    /// Kind of file.
    pub kind: FileKind,
    /// Person and side.
    #[serde(flatten)]
    pub limb: LimbId,
    /// Half degrees of medial rotation.
    pub step: u32,
    /// Degrees of medial rotation.
    pub angle_deg: f64,
    /// Camera of a depth image.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub camera: Option<View>,
    /// Body shape; radiographs show the scan itself.
    pub shape: BodyShape,
    /// Depth images of other body shapes: how much more volume the skin encloses than that of the scan, mm³.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub volume_change_mm3: Option<f64>,
    /// Depth images: pixels that see something beyond the 65.535 m that fit in 16 bits; they are 0 in the file.
    #[serde(skip_serializing_if = "is_zero", default)]
    pub too_far_pixels: usize,
    /// Share of the image's region of interest where the field of view of the scan cuts off the limb: pixels of a depth image that see the
    /// cut, or rays of a radiograph that pass through it. Left out if it is 0.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub cut_share: Option<f64>,
    /// The limb's frame in the scan: T^P_CT.
    pub patient_from_ct: TransformRows,
    /// Pose of the limb: T^ToF_P = T_opt · T_mat · T_rot.
    pub room_from_patient: TransformRows,
    /// Radiographs: pose of the x-ray device in the scan.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub ct_from_device: Option<TransformRows>,
    /// Radiographs: tube load that corresponds to the noise of the image, mAs; left out for the expected image and if the fluence of the
    /// tube is unknown.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub mas: Option<f64>,
    /// Radiographs: exposure index of IEC 62494-1.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub exposure_index: Option<f64>,
    /// Seed of a radiograph's histories and noise, or of a depth sensor's noise.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub seed: Option<u64>,
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde calls it with a reference"
)]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

impl FileRow {
    /// Checks that the row fits the layout: its angle is on the grid, its path is that of such an image.
    pub fn check(&self) -> Result<(), String> {
        let (step, angle) = (self.step, self.angle_deg);
        if angle != f64::from(step) / 2.0 {
            return Err(format!(
                "the angle is {angle} degrees, expected half of step {step}"
            ));
        }
        let expected = match (self.kind, self.camera) {
            (FileKind::Depth, Some(view)) => self.limb.depth(self.shape, view, step),
            (FileKind::Depth, None) => return Err("a depth image without a camera".to_owned()),
            (FileKind::Radiograph, _) => self.limb.radiograph_png(step),
            (FileKind::RadiographTallies, _) => self.limb.radiograph_exr(step),
        };
        if self.file != expected {
            return Err(format!("the file is {}, expected {expected}", self.file));
        }
        Ok(())
    }
}

/// Region of interest of a depth image, as published: pixels from the top left corner.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RoiRow {
    /// The camera.
    pub camera: View,
    /// Number of the pose: the step.
    pub image_number: u32,
    /// First column.
    pub x_start: u32,
    /// First row.
    pub y_start: u32,
    /// Columns and rows.
    pub size: u32,
}

/// `roi_depth.json`: maps the name of a depth image to its region; the same for all body shapes.
pub type RoiFile = BTreeMap<String, RoiRow>;

/// `roi_depth.json` as text.
pub fn roi_text(rois: &RoiFile) -> String {
    serde_json::to_string_pretty(rois).expect("regions hold only JSON values")
}

/// All rows of a dataset, in the order of its plan.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Manifest {
    /// Root of the dataset.
    pub root: PathBuf,
    /// One row per image.
    pub files: Vec<FileRow>,
}

impl Manifest {
    /// Its file in a dataset.
    pub const FILE: &str = "manifest.jsonl";

    /// Reads `manifest.jsonl`.
    ///
    /// # Errors
    /// [`FileError`] when the file is missing or one of its lines is not a row.
    pub fn read(root: &Path) -> Result<Self, FileError> {
        require_folder(root)?;
        let path = root.join(Self::FILE);
        let text = read_text(&path).map_err(|mut error| {
            if error.source.kind() == io::ErrorKind::NotFound {
                let why = "`ppa generate` and `ppa merge` write it once all poses are made; \
                           datasets of other programs do not have it";
                error.source = io::Error::new(io::ErrorKind::NotFound, why);
            }
            error
        })?;
        let row = |(i, line)| {
            let row: FileRow =
                serde_json::from_str(line).map_err(|e| format!("line {}: {e}", i + 1))?;
            row.check().map_err(|e| format!("line {}: {e}", i + 1))?;
            Ok::<_, String>(row)
        };
        let rows = text.lines().enumerate().map(row).collect::<Result<_, _>>();
        Ok(Self {
            root: root.to_owned(),
            files: rows.map_err(|e| FileError::at("parse", &path)(io::Error::other(e)))?,
        })
    }

    /// One line of JSON per row.
    pub fn to_text(&self) -> String {
        let line = |row| serde_json::to_string(row).expect("rows hold only JSON values") + "\n";
        self.files.iter().map(line).collect()
    }

    /// The regions of interest of one limb.
    ///
    /// # Errors
    /// [`FileError`] when its `roi_depth.json` is missing or malformed.
    pub fn rois(&self, limb: LimbId) -> Result<RoiFile, FileError> {
        let path = self.root.join(limb.roi_file());
        serde_json::from_str(&read_text(&path)?)
            .map_err(|e| FileError::at("parse", &path)(e.into()))
    }

    /// The limbs in the manifest, in order.
    pub fn limbs(&self) -> Vec<LimbId> {
        let mut limbs: Vec<_> = self.files.iter().map(|row| row.limb).collect();
        limbs.sort_unstable();
        limbs.dedup();
        limbs
    }
}
