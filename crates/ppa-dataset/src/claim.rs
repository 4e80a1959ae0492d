//! A dataset's folder, claimed by one run at a time.

use std::collections::HashSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::files::FileError;
use crate::record::FOLDER;

/// Why a folder cannot take the images of a run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FolderError {
    /// The folder holds poses that the run does not.
    #[error(
        "{} holds a dataset of another plan or shard (its {record} is not in this one); choose another folder",
        root.display()
    )]
    OtherPlan {
        /// The dataset's folder.
        root: PathBuf,
        /// The record of a pose that is not in the run.
        record: String,
    },
    /// The folder holds something else.
    #[error("{} is neither empty nor a dataset that ppa generate began", .0.display())]
    NotADataset(PathBuf),
    /// Another process writes here.
    #[error("{} is being written by another process", .0.display())]
    Busy(PathBuf),
    /// A file of the dataset.
    #[error(transparent)]
    File(#[from] FileError),
}

/// Held while a process relies on a dataset's files; released when dropped or when the process dies.
pub(crate) struct Claim(#[expect(dead_code, reason = "holds the lock")] fs::File);

/// Claims a folder that holds a dataset, finished or not, and changes nothing in it.
pub(crate) fn claim_existing(root: &Path) -> Result<Claim, FolderError> {
    let folder = root.join(FOLDER);
    if !folder.is_dir() {
        return Err(FolderError::NotADataset(root.to_owned()));
    }
    let path = folder.join("lock");
    let lock = fs::File::create(&path).map_err(FileError::at("create", &path))?;
    match lock.try_lock() {
        Ok(()) => Ok(Claim(lock)),
        Err(fs::TryLockError::WouldBlock) => Err(FolderError::Busy(root.to_owned())),
        Err(fs::TryLockError::Error(e)) => Err(FileError::at("lock", &path)(e).into()),
    }
}

/// Claims the folder `root` for a run that makes the records `planned`, and clears what a killed
/// run left.
///
/// Refuses a folder that another run writes to, that holds something else, or that holds records
/// which are not planned.
pub(crate) fn claim(root: &Path, planned: &HashSet<String>) -> Result<Claim, FolderError> {
    let folder = root.join(FOLDER);
    let occupied = root.exists() && {
        let mut entries = fs::read_dir(root).map_err(FileError::at("read", root))?;
        entries.next().is_some()
    };
    if occupied && !folder.is_dir() {
        return Err(FolderError::NotADataset(root.to_owned()));
    }
    fs::create_dir_all(&folder).map_err(FileError::at("create folder", &folder))?;
    let claim = claim_existing(root)?;
    for record in record_names(root)? {
        if !planned.contains(&record) {
            return Err(FolderError::OtherPlan {
                root: root.to_owned(),
                record,
            });
        }
    }
    remove_unfinished(root).map_err(FileError::at("clear", root))?;
    Ok(claim)
}

/// Names of the records in a dataset.
pub(crate) fn record_names(root: &Path) -> Result<Vec<String>, FileError> {
    let folder = root.join(FOLDER);
    let read = FileError::at("read", &folder);
    let names = fs::read_dir(&folder).and_then(|entries| {
        let names = entries.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()));
        names.collect::<io::Result<Vec<_>>>()
    });
    let is_record = |name: &String| name.ends_with(".json") && !name.starts_with('.');
    Ok(names.map_err(read)?.into_iter().filter(is_record).collect())
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
