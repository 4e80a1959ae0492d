//! Files that a run did not write but whose place it needs: moved to `.ppa/altered`, never overwritten.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use ppa_dataset::files::{FileError, write_whole};

use crate::pose_id::FOLDER;

/// Keeps the files of one dataset that are in no record.
pub(crate) struct SetAside<'a> {
    root: &'a Path,
    kept: Mutex<Vec<String>>,
}

impl<'a> SetAside<'a> {
    pub fn new(root: &'a Path) -> Self {
        let kept = Mutex::default();
        Self { root, kept }
    }

    /// Moves a file, given by its path from the root, to the same path below `.ppa/altered`; a number is added if that path exists.
    pub fn keep(&self, file: &str) -> Result<(), FileError> {
        let folder = format!("{FOLDER}/altered");
        let mut to = format!("{folder}/{file}");
        let mut number = 1;
        while self.root.join(&to).symlink_metadata().is_ok() {
            to = format!("{folder}/{file}.{number}");
            number += 1;
        }
        move_file(&self.root.join(file), &self.root.join(&to))?;
        self.kept.lock().unwrap_or_else(|e| e.into_inner()).push(to);
        Ok(())
    }

    /// New paths of the files, from the root.
    pub fn into_kept(self) -> Vec<String> {
        let mut kept = self.kept.into_inner().unwrap_or_else(|e| e.into_inner());
        kept.sort();
        kept
    }
}

/// Moves a file, replacing an existing one and creating the folder if needed.
pub(crate) fn move_file(from: &Path, to: &Path) -> Result<(), FileError> {
    let folder = to.parent().map_or_else(PathBuf::new, Path::to_owned);
    fs::create_dir_all(&folder).map_err(FileError::at("create folder", &folder))?;
    match fs::rename(from, to) {
        // A folder of the dataset may be a link to another disk.
        Err(error) if error.kind() == io::ErrorKind::CrossesDevices => {
            let bytes = fs::read(from).map_err(FileError::at("read", from))?;
            write_whole(to, &bytes)?;
            fs::remove_file(from).map_err(FileError::at("remove", from))
        }
        moved => moved.map_err(FileError::at("write", to)),
    }
}
