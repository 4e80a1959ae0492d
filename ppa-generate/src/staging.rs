//! Complete files for a dataset: made in `.ppa/new`, then moved into place.
//!
//! A pose has many files, so a run may be killed between two moves. Its new record is therefore written to `.ppa/new` before the first move
//! and moved into place after the last: the next run completes the poses that it finds there. Until then the files of an earlier record
//! stay as they are.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use ppa_dataset::files::{FileError, remove_if_there, sha256_of_file, write_whole};

use crate::pose_id::PoseId;

use crate::pose_id::FOLDER;
use crate::record::{FoundRecord, Record, record_names};
use crate::set_aside::{SetAside, move_file};

/// Folder in which a run makes images, under the same paths as in the dataset.
pub(crate) fn staging_folder(root: &Path) -> PathBuf {
    root.join(FOLDER).join("new")
}

/// Whether a run was killed while it moved the files of a pose into place.
pub(crate) fn is_interrupted(root: &Path, pose: PoseId) -> bool {
    staging_folder(root).join(pose.record_name()).exists()
}

/// The staging folder of a dataset that is locked for writing.
pub(crate) struct Staging<'a> {
    root: &'a Path,
    folder: PathBuf,
    pub aside: SetAside<'a>,
}

impl<'a> Staging<'a> {
    pub fn new(root: &'a Path) -> Self {
        Self {
            root,
            folder: staging_folder(root),
            aside: SetAside::new(root),
        }
    }

    /// Completes the poses that a killed run was moving into place, and removes everything else that it left here.
    pub fn recover(&self) -> Result<(), FileError> {
        if !self.folder.exists() {
            return Ok(());
        }
        for pose in record_names(&self.folder)? {
            let intent = Record::look(&self.folder.join(pose.record_name()), pose)?;
            match intent.whole() {
                Some(record) if self.has_all(record) => self.complete(pose, record)?,
                Some(record) => self.withdraw(pose, record)?,
                None => {}
            }
        }
        self.clear()
    }

    /// Removes the images of a pose that cannot be completed, since one of them is lost.
    fn withdraw(&self, pose: PoseId, record: &Record) -> Result<(), FileError> {
        let earlier = Record::look(&self.root.join(pose.record_file()), pose)?;
        for row in &record.files {
            let path = self.root.join(&row.file);
            let earlier = earlier.whole().and_then(|record| record.hash_of(&row.file));
            let found = hash_if_there(&path)?;
            if found.as_deref() == Some(row.sha256.as_str()) && found.as_deref() != earlier {
                remove_if_there(&path)?;
            }
        }
        Ok(())
    }

    /// Whether each image of a record is here or in its place.
    fn has_all(&self, record: &Record) -> bool {
        record.files.iter().all(|row| {
            let here = |folder: &Path| {
                sha256_of_file(&folder.join(&row.file)).is_ok_and(|found| found == row.sha256)
            };
            here(&self.folder) || here(self.root)
        })
    }

    /// Moves the images of a pose, which were made here, and its record into place. Images of the earlier record are removed; other files
    /// there are set aside.
    pub fn put(&self, pose: PoseId, record: &Record) -> Result<(), FileError> {
        let intent = self.folder.join(pose.record_name());
        write_whole(&intent, record.to_text().as_bytes())?;
        self.complete(pose, record)
    }

    fn complete(&self, pose: PoseId, record: &Record) -> Result<(), FileError> {
        let earlier = self.cleared(pose, Some(record))?;
        if let FoundRecord::Damaged = earlier {
            self.aside.keep(&pose.record_file())?;
        }
        for row in &record.files {
            let staged = self.folder.join(&row.file);
            if staged.exists() {
                move_file(&staged, &self.root.join(&row.file))?;
            }
        }
        let intent = self.folder.join(pose.record_name());
        move_file(&intent, &self.root.join(pose.record_file()))
    }

    /// Removes a recorded pose with its images.
    pub fn remove(&self, pose: PoseId) -> Result<(), FileError> {
        match self.cleared(pose, None)? {
            FoundRecord::Damaged => self.aside.keep(&pose.record_file())?,
            _ => remove_if_there(&self.root.join(pose.record_file()))?,
        }
        for file in pose.images() {
            self.remove_empty_folders(&file);
        }
        Ok(())
    }

    /// Clears the place of a pose's images, except those that already match `next`. Returns the earlier record.
    fn cleared(&self, pose: PoseId, next: Option<&Record>) -> Result<FoundRecord, FileError> {
        let earlier = Record::look(&self.root.join(pose.record_file()), pose)?;
        for file in pose.images() {
            let path = self.root.join(&file);
            let Some(found) = hash_if_there(&path)? else {
                continue;
            };
            let is_of = |record: Option<&Record>| {
                record.and_then(|record| record.hash_of(&file)) == Some(found.as_str())
            };
            if is_of(next) {
                remove_if_there(&self.folder.join(&file))?;
            } else if !is_of(earlier.whole()) {
                self.aside.keep(&file)?;
            } else if next.is_none_or(|record| record.hash_of(&file).is_none()) {
                remove_if_there(&path)?;
            }
        }
        Ok(earlier)
    }

    /// Writes a list of the dataset.
    pub fn write(&self, file: &str, text: &str) -> Result<(), FileError> {
        let staged = self.folder.join(file);
        write_whole(&staged, text.as_bytes())?;
        move_file(&staged, &self.root.join(file))
    }

    /// Removes a list that has the given hash; if it has another one, sets it aside and returns `true`.
    pub fn retire(&self, file: &str, hash: Option<&str>) -> Result<bool, FileError> {
        let path = self.root.join(file);
        match hash_if_there(&path)? {
            None => Ok(false),
            Some(found) if hash == Some(found.as_str()) => remove_if_there(&path).map(|()| false),
            Some(_) => self.aside.keep(file).map(|()| true),
        }
    }

    /// Removes the empty folders above a file.
    pub fn remove_empty_folders(&self, file: &str) {
        let above = Path::new(file).ancestors().skip(1);
        for folder in above.filter(|folder| !folder.as_os_str().is_empty()) {
            // A folder that holds something stays, which is not an error.
            if fs::remove_dir(self.root.join(folder)).is_err() {
                return;
            }
        }
    }

    /// Removes images that were made here and are not wanted.
    pub fn discard(&self, record: &Record) -> Result<(), FileError> {
        let mut files = record.files.iter();
        files.try_for_each(|row| remove_if_there(&self.folder.join(&row.file)))
    }

    /// Removes the staging folder.
    pub fn clear(&self) -> Result<(), FileError> {
        match fs::remove_dir_all(&self.folder) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                Err(FileError::at("clear", &self.folder)(error))
            }
            _ => Ok(()),
        }
    }
}

/// Hash of a file; `None` if there is none.
fn hash_if_there(path: &Path) -> Result<Option<String>, FileError> {
    match sha256_of_file(path) {
        Err(error) if error.source.kind() == io::ErrorKind::NotFound => Ok(None),
        found => found.map(Some),
    }
}
