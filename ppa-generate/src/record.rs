//! Records of finished poses, stored in the dataset, from which a run resumes.

use std::fmt;
use std::fs;
use std::io;
use std::path::Path;

use ppa_dataset::files::{FileError, hex, sha256_of_file};
use ppa_dataset::findings::Finding;
use ppa_dataset::layout::LimbId;
use ppa_dataset::manifest::{FileRow, RoiFile};
use ppa_scene::PoseAngle;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::pose_id::PoseId;
use crate::seal::{Opened, opened, sealed};

/// The generation of one pose of one limb.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PoseJob<'a> {
    /// The limb.
    pub limb: LimbId,
    /// Its rotation.
    pub pose: PoseAngle,
    /// Hash of everything that determines the limb's images, except the pose.
    pub limb_key: &'a str,
}

impl PoseJob<'_> {
    /// Identity of the pose.
    pub fn id(&self) -> PoseId {
        PoseId {
            limb: self.limb,
            step: self.pose.step,
        }
    }

    /// Hash of everything that determines its images.
    pub fn key(&self) -> String {
        let address = format!("{}/{}", self.limb_key, self.pose.step);
        hex(&Sha256::digest(address.as_bytes()))
    }
}

impl fmt::Display for PoseJob<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.id().fmt(f)
    }
}

/// The poses with records in a folder, in order.
pub(crate) fn record_names(folder: &Path) -> Result<Vec<PoseId>, FileError> {
    let names = fs::read_dir(folder).and_then(|entries| {
        let names = entries.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()));
        names.collect::<io::Result<Vec<_>>>()
    });
    let names = names.map_err(FileError::at("read", folder))?;
    let mut poses: Vec<_> = names
        .iter()
        .filter_map(|name| PoseId::of_record(name))
        .collect();
    poses.sort_unstable();
    Ok(poses)
}

/// Record of a finished pose: put in its place after all its files, so that its presence proves theirs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Record {
    /// Hash of everything that determines the pose's bytes.
    pub key: String,
    /// Its images.
    pub files: Vec<FileRow>,
    /// Its regions of interest.
    pub rois: RoiFile,
    /// Findings about the limb and about this pose.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<Finding>,
}

/// Content of a record's file.
#[derive(Debug)]
pub(crate) enum FoundRecord {
    /// There is no file.
    Absent,
    /// A record with a valid seal, or one of an earlier version, which had none.
    Whole(Record),
    /// A file that is not a record of this pose, or was altered.
    Damaged,
}

impl FoundRecord {
    /// The record, if there is one.
    pub fn whole(&self) -> Option<&Record> {
        match self {
            Self::Whole(record) => Some(record),
            _ => None,
        }
    }
}

impl Record {
    /// Reads the file of a pose's record.
    pub fn look(path: &Path, pose: PoseId) -> Result<FoundRecord, FileError> {
        match ppa_core::regular_file::read(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(FoundRecord::Absent),
            Err(error) => Err(FileError::at("read", path)(error)),
            Ok(bytes) => Ok(Self::of_bytes(bytes, pose)),
        }
    }

    /// Parses the bytes of a pose's record file.
    pub fn of_bytes(bytes: Vec<u8>, pose: PoseId) -> FoundRecord {
        let text = String::from_utf8(bytes).ok();
        let record = text.and_then(|text| Self::parse(&text, pose));
        record.map_or(FoundRecord::Damaged, FoundRecord::Whole)
    }

    /// The record in a text, if it is unaltered and of the given pose.
    fn parse(text: &str, pose: PoseId) -> Option<Self> {
        let record: Self = match opened(text) {
            Opened::Sealed(text) => serde_json::from_str(&text).ok()?,
            Opened::Unsealed => serde_json::from_str(text).ok()?,
            Opened::Broken => return None,
        };
        let is_of_pose =
            |row: &FileRow| (row.limb, row.step) == (pose.limb, pose.step) && row.check().is_ok();
        record.files.iter().all(is_of_pose).then_some(record)
    }

    /// Reads the record of a pose.
    pub fn read(root: &Path, pose_job: &PoseJob) -> Result<Self, FileError> {
        let path = root.join(pose_job.id().record_file());
        let because = |kind, what| FileError::at("read", &path)(io::Error::new(kind, what));
        match Self::look(&path, pose_job.id())? {
            FoundRecord::Whole(record) => Ok(record),
            FoundRecord::Absent => Err(because(io::ErrorKind::NotFound, "there is no such record")),
            FoundRecord::Damaged => {
                Err(because(io::ErrorKind::InvalidData, "the record is damaged"))
            }
        }
    }

    /// The record with its seal.
    pub fn to_text(&self) -> String {
        sealed(&serde_json::to_string(self).expect("records hold only JSON values"))
    }

    /// The recorded hash of an image.
    pub fn hash_of(&self, file: &str) -> Option<&str> {
        let row = self.files.iter().find(|row| row.file == file);
        row.map(|row| row.sha256.as_str())
    }

    /// Its images that are missing or have another hash.
    pub fn damaged_images(&self, root: &Path) -> Vec<String> {
        let intact = |row: &&FileRow| {
            sha256_of_file(&root.join(&row.file)).is_ok_and(|found| found == row.sha256)
        };
        let damaged = self.files.iter().filter(|row| !intact(row));
        damaged.map(|row| row.file.clone()).collect()
    }

    /// Bytes of its images below a folder.
    pub fn size(&self, root: &Path) -> Result<u64, FileError> {
        let size = |row: &FileRow| {
            let path = root.join(&row.file);
            let metadata = fs::metadata(&path).map_err(FileError::at("read", &path))?;
            Ok(metadata.len())
        };
        self.files.iter().map(size).sum()
    }

    /// Bytes of its images that exist.
    pub fn size_of_rest(&self, root: &Path) -> u64 {
        let size =
            |row: &FileRow| fs::metadata(root.join(&row.file)).map_or(0, |found| found.len());
        self.files.iter().map(size).sum()
    }
}
