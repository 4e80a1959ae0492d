//! Reads the files of a dataset or shard from a folder or an archive.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use ppa_core::Part;
use ppa_dataset::archive::is_archive;
use ppa_dataset::files::FileError;
use ppa_dataset::findings::Findings;
use ppa_dataset::manifest::DESCRIPTION_FILE;

use crate::archived_dataset::ArchivedDataset;
use crate::dataset_lock::FolderError;
use crate::part_file::{PART_FILE, part_of_text};
use crate::planned::Planned;
use crate::pose_id::{FOLDER, PoseId};
use crate::record::{FoundRecord, Record, record_names};

/// A dataset or shard, finished or not.
pub(crate) struct DatasetFiles {
    root: PathBuf,
    /// `None` for a folder.
    archive: Option<ArchivedDataset>,
}

impl DatasetFiles {
    /// Opens a folder or an archive.
    ///
    /// # Errors
    /// [`FolderError`] for an archive that cannot be read or holds something else.
    pub fn open(root: &Path) -> Result<Self, FolderError> {
        let open = || ArchivedDataset::open(root);
        Ok(Self {
            root: root.to_owned(),
            archive: is_archive(root).then(open).transpose()?,
        })
    }

    /// Whether no run has written to an archive yet.
    pub fn is_empty_archive(&self) -> bool {
        self.archive.as_ref().is_some_and(ArchivedDataset::is_empty)
    }

    /// Whether it is a complete archive, written after the last pose.
    pub fn is_finished_archive(&self) -> bool {
        let archive = self.archive.as_ref();
        archive.is_some_and(ArchivedDataset::is_finished)
    }

    /// The files of an archive in a temporary folder; `None` for a folder.
    pub fn extracted(&self) -> Result<Option<tempfile::TempDir>, FileError> {
        let archive = self.archive.as_ref();
        archive.map(ArchivedDataset::extracted).transpose()
    }

    /// The folder or the archive.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Path of a file, for messages.
    pub fn path(&self, file: &str) -> PathBuf {
        self.root.join(file)
    }

    /// Reads a file; `None` if there is none of this name.
    pub fn read(&self, file: &str) -> Result<Option<Vec<u8>>, FileError> {
        if let Some(archive) = &self.archive {
            return archive.read(file);
        }
        let path = self.path(file);
        match ppa_core::regular_file::read(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            bytes => bytes.map(Some).map_err(FileError::at("read", &path)),
        }
    }

    /// Reads a file that must exist.
    pub fn required(&self, file: &str) -> Result<Vec<u8>, FileError> {
        self.read(file)?.ok_or_else(|| self.absent(file))
    }

    fn absent(&self, file: &str) -> FileError {
        FileError::at("read", &self.path(file))(io::ErrorKind::NotFound.into())
    }

    fn text(&self, file: &str) -> Result<Option<String>, FileError> {
        let Some(bytes) = self.read(file)? else {
            return Ok(None);
        };
        let invalid = |_| io::Error::from(io::ErrorKind::InvalidData);
        let text = String::from_utf8(bytes).map_err(invalid);
        text.map(Some)
            .map_err(FileError::at("read", &self.path(file)))
    }

    /// Size of a file in bytes; `None` if there is none of this name.
    pub fn size(&self, file: &str) -> Option<u64> {
        match &self.archive {
            Some(archive) => archive.size(file),
            None => fs::metadata(self.path(file)).ok().map(|found| found.len()),
        }
    }

    /// Intended content of the dataset.
    pub fn planned(&self) -> Result<Planned, FileError> {
        let text = self.text(DESCRIPTION_FILE)?;
        let text = text.ok_or_else(|| self.absent(DESCRIPTION_FILE))?;
        Planned::of_text(text, &self.path(DESCRIPTION_FILE))
    }

    /// The part of its plan that the dataset should hold.
    pub fn part(&self) -> Result<Part, FileError> {
        match self.text(PART_FILE)? {
            None => Ok(Part::WHOLE),
            Some(text) => part_of_text(&text, &self.path(PART_FILE)),
        }
    }

    /// The poses that have a record, in order.
    pub fn poses(&self) -> Result<Vec<PoseId>, FileError> {
        match &self.archive {
            Some(archive) => Ok(archive.poses()),
            None => record_names(&self.path(FOLDER)),
        }
    }

    /// Reads the record of a pose and reports whether it is whole, damaged or absent.
    pub fn look(&self, pose: PoseId) -> Result<FoundRecord, FileError> {
        let bytes = self.read(&pose.record_file())?;
        Ok(bytes.map_or(FoundRecord::Absent, |bytes| Record::of_bytes(bytes, pose)))
    }

    /// The findings of its limbs and poses.
    pub fn findings(&self) -> Result<Findings, FileError> {
        match self.text(Findings::FILE)? {
            None => Ok(Findings::default()),
            Some(text) => Findings::of_text(&text, &self.path(Findings::FILE)),
        }
    }
}
