//! Records of finished poses, kept in the dataset: what makes a run resumable.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use ppa_scene::PoseAngle;
use serde::{Deserialize, Serialize};

use crate::files::{FileError, read_text, sha256_of_file, write_whole};
use crate::generate::GenerateError;
use crate::layout::LimbId;
use crate::manifest::{FileRow, RoiFile};

/// Folder inside a dataset that holds the records.
const FOLDER: &str = ".ppa";

/// A finished pose: written after all its files, so its presence proves them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Record {
    /// Hash of everything the pose's bytes follow from.
    pub key: String,
    /// Its images.
    pub files: Vec<FileRow>,
    /// Its regions of interest.
    pub rois: RoiFile,
}

impl Record {
    /// The record of a pose when key and every file still agree with it, else `None`.
    pub fn of_complete(root: &Path, limb: LimbId, pose: PoseAngle, key: &str) -> Option<Self> {
        let text = fs::read_to_string(path(root, limb, pose)).ok()?;
        let record: Self = serde_json::from_str(&text).ok()?;
        let intact = |row: &FileRow| {
            sha256_of_file(&root.join(&row.file)).is_ok_and(|found| found == row.sha256)
        };
        (record.key == key && record.files.iter().all(intact)).then_some(record)
    }

    /// Reads the record of a pose.
    pub fn read(root: &Path, limb: LimbId, pose: PoseAngle) -> Result<Self, FileError> {
        let path = path(root, limb, pose);
        serde_json::from_str(&read_text(&path)?)
            .map_err(|e| FileError::at("parse", &path)(e.into()))
    }

    /// Writes it: the last step of a pose.
    pub fn write(&self, root: &Path, limb: LimbId, pose: PoseAngle) -> Result<(), FileError> {
        let text = serde_json::to_string(self).expect("records hold only JSON values");
        write_whole(&path(root, limb, pose), text.as_bytes())
    }
}

fn name(limb: LimbId, pose: PoseAngle) -> String {
    format!(
        "patient_{}_{}_{:03}.json",
        limb.patient,
        limb.side_letter(),
        pose.step
    )
}

fn path(root: &Path, limb: LimbId, pose: PoseAngle) -> PathBuf {
    root.join(FOLDER).join(name(limb, pose))
}

/// Held while a run writes into a dataset; released when dropped or when the process dies.
pub(crate) struct Claim(#[expect(dead_code, reason = "holds the lock")] fs::File);

/// Claims the folder `root` for one run over the given poses, and clears what a killed run left.
///
/// Refuses a folder that another run writes to, that holds something else, or that holds poses
/// which are not among `units`.
pub(crate) fn claim(
    root: &Path,
    units: impl Iterator<Item = (LimbId, PoseAngle)>,
) -> Result<Claim, GenerateError> {
    let folder = root.join(FOLDER);
    let occupied = root.exists() && {
        let mut entries = fs::read_dir(root).map_err(FileError::at("read", root))?;
        entries.next().is_some()
    };
    if occupied && !folder.is_dir() {
        return Err(GenerateError::NotADataset(root.to_owned()));
    }
    fs::create_dir_all(&folder).map_err(FileError::at("create folder", &folder))?;
    let lock_path = folder.join("lock");
    let lock = fs::File::create(&lock_path).map_err(FileError::at("create", &lock_path))?;
    match lock.try_lock() {
        Ok(()) => {}
        Err(fs::TryLockError::WouldBlock) => return Err(GenerateError::Busy(root.to_owned())),
        Err(fs::TryLockError::Error(e)) => {
            return Err(FileError::at("lock", &lock_path)(e).into());
        }
    }
    let planned: Vec<String> = units.map(|(limb, pose)| name(limb, pose)).collect();
    for entry in fs::read_dir(&folder).map_err(FileError::at("read", &folder))? {
        let entry = entry.map_err(FileError::at("read", &folder))?;
        let record = entry.file_name().to_string_lossy().into_owned();
        if record.ends_with(".json") && !planned.contains(&record) {
            return Err(GenerateError::OtherPlan {
                root: root.to_owned(),
                record,
            });
        }
    }
    remove_unfinished(root).map_err(FileError::at("clear", root))?;
    Ok(Claim(lock))
}

/// Removes temporary files (`.name.random`) that a killed run left behind.
fn remove_unfinished(root: &Path) -> io::Result<()> {
    for entry in fs::read_dir(root)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.file_type()?.is_dir() {
            if name == FOLDER || name.starts_with("patient_") {
                remove_hidden(&entry.path())?;
            }
        } else if [".manifest.jsonl.", ".dataset.json."]
            .iter()
            .any(|p| name.starts_with(p))
        {
            fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

fn remove_hidden(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            remove_hidden(&entry.path())?;
        } else if entry.file_name().to_string_lossy().starts_with('.') {
            fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}
