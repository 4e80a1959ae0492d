//! Records of finished poses, kept in the dataset: what makes a run resumable.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use ppa_scene::PoseAngle;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::files::{FileError, hex, read_text, sha256_of_file, write_whole};
use crate::findings::Finding;
use crate::layout::{LimbId, angle_text};
use crate::manifest::{FileRow, RoiFile};

/// Folder inside a dataset that holds the records.
pub(crate) const FOLDER: &str = ".ppa";

/// One pose of one limb: the unit of work.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Unit<'a> {
    /// The limb.
    pub limb: LimbId,
    /// Its rotation.
    pub pose: PoseAngle,
    /// Hash of everything the limb's images follow from, but the pose.
    pub limb_key: &'a str,
}

impl Unit<'_> {
    /// File name of its record.
    pub fn record_name(&self) -> String {
        self.limb.unit_name(self.pose.step) + ".json"
    }

    fn path(&self, root: &Path) -> PathBuf {
        root.join(FOLDER).join(self.record_name())
    }

    /// Hash of everything its images follow from.
    pub fn key(&self) -> String {
        let address = format!("{}/{}", self.limb_key, self.pose.step);
        hex(&Sha256::digest(address.as_bytes()))
    }
}

impl fmt::Display for Unit<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (patient, side) = (self.limb.patient, self.limb.side_letter());
        let angle = angle_text(self.pose.step);
        write!(f, "limb {side} of patient {patient} at {angle} degrees")
    }
}

/// A finished pose: written after all its files, so its presence proves them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Record {
    /// Hash of everything the pose's bytes follow from.
    pub key: String,
    /// Its images.
    pub files: Vec<FileRow>,
    /// Its regions of interest.
    pub rois: RoiFile,
    /// Doubts about the limb and about this pose.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<Finding>,
}

impl Record {
    /// The record of a pose when key and every file still agree with it, else `None`.
    pub fn of_complete(root: &Path, unit: &Unit) -> Option<Self> {
        let text = ppa_files::read_to_string(unit.path(root)).ok()?;
        let record: Self = serde_json::from_str(&text).ok()?;
        let intact = |row: &FileRow| {
            sha256_of_file(&root.join(&row.file)).is_ok_and(|found| found == row.sha256)
        };
        (record.key == unit.key() && record.files.iter().all(intact)).then_some(record)
    }

    /// Reads the record of a pose.
    pub fn read(root: &Path, unit: &Unit) -> Result<Self, FileError> {
        let path = unit.path(root);
        serde_json::from_str(&read_text(&path)?)
            .map_err(|e| FileError::at("parse", &path)(e.into()))
    }

    /// Writes it: the last step of a pose.
    pub fn write(&self, root: &Path, unit: &Unit) -> Result<(), FileError> {
        let text = serde_json::to_string(self).expect("records hold only JSON values");
        write_whole(&unit.path(root), text.as_bytes())
    }

    /// Bytes of its images on disk.
    pub fn size(&self, root: &Path) -> Result<u64, FileError> {
        let size = |row: &FileRow| {
            let path = root.join(&row.file);
            let metadata = fs::metadata(&path).map_err(FileError::at("read", &path))?;
            Ok(metadata.len())
        };
        self.files.iter().map(size).sum()
    }
}
