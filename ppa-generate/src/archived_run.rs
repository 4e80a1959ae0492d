//! A run whose dataset is an archive: poses are made in a temporary folder and added to the archive one by one.
//!
//! The temporary folder is where the system keeps such folders (`TMPDIR`), on the disk of the node, so that a shared file system sees one
//! file. A killed run loses the poses in progress; the next run extracts the others and resumes.

use std::fs;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use ppa_dataset::archive;
use ppa_dataset::files::FileError;
use ppa_dataset::manifest::DESCRIPTION_FILE;

use crate::archived_dataset::ArchivedDataset;
use crate::dataset_lock::{FolderError, lock_archive};
use crate::job::{JobError, Summary};
use crate::keep_damaged::keep_damaged;
use crate::limb_jobs::LimbJobs;
use crate::part_file::{PART_FILE, read_part};
use crate::planned::Planned;
use crate::pose_id::{FOLDER, PoseId};
use crate::record::Record;
use crate::staging::staging_folder;
use crate::write_archive::{NamedBytes, write_archive};

/// The archive of a run, locked, and the folder in which the run makes its poses.
pub(crate) struct ArchivedRun<'a> {
    path: &'a Path,
    scratch: tempfile::TempDir,
    growing: Mutex<Growing>,
}

/// The archive as the run extends it.
struct Growing {
    file: fs::File,
    /// Offset at which the next pose is written.
    end: u64,
    /// `dataset.json` and `.ppa/part` as last written to it.
    stated: Vec<NamedBytes>,
}

impl<'a> ArchivedRun<'a> {
    /// Locks the archive, creating it if it does not exist, lets `make` complete the dataset in the folder of the run and call
    /// [`ArchivedRun::add`] for each pose, and writes the archive of the result. If `make` fails, the archive keeps the poses that were
    /// added.
    ///
    /// # Errors
    /// [`FolderError`] if another process uses the archive or if it holds something else, and errors of `make`.
    pub fn complete<E: From<JobError>>(
        path: &'a Path,
        make: impl FnOnce(&Self) -> Result<Summary, E>,
    ) -> Result<Summary, E> {
        let run = Self::begin(path).map_err(JobError::from)?;
        match make(&run) {
            Ok(mut summary) => {
                run.finish(&mut summary).map_err(JobError::from)?;
                Ok(summary)
            }
            Err(error) => {
                run.remove_if_empty();
                Err(error)
            }
        }
    }

    fn begin(path: &'a Path) -> Result<Self, FolderError> {
        let file = lock_archive(path)?;
        let found = ArchivedDataset::open(path)?;
        let scratch = found.extracted()?;
        Ok(Self {
            path,
            growing: Mutex::new(Growing {
                file,
                end: found.end(),
                stated: statements(scratch.path())?,
            }),
            scratch,
        })
    }

    /// The folder of the dataset while the run makes it.
    pub fn folder(&self) -> &Path {
        self.scratch.path()
    }

    /// Appends a pose of the folder to the archive, after `dataset.json` if that has changed.
    pub fn add(&self, pose: PoseId, record: &Record) -> Result<(), FileError> {
        let root = self.folder();
        let mut members = Vec::new();
        let mut growing = self.growing.lock().unwrap_or_else(PoisonError::into_inner);
        let stated = statements(root)?;
        if stated != growing.stated {
            members.extend(stated.iter().cloned());
        }
        members.extend(files_of(root, pose, record)?);
        let Growing { file, end, .. } = &mut *growing;
        let extended = archive::extend(file, *end, &members);
        growing.end = extended.map_err(FileError::at("write", self.path))?;
        growing.stated = stated;
        Ok(())
    }

    fn remove_if_empty(&self) {
        let growing = self.growing.lock().unwrap_or_else(PoisonError::into_inner);
        if growing.file.metadata().is_ok_and(|found| found.len() == 0) {
            // Only the error that ended the run is reported.
            let _ = fs::remove_file(self.path);
        }
    }

    /// Replaces the growing archive by that of the complete dataset. One with damaged members is kept next to it as `*.damagedN`.
    fn finish(&self, summary: &mut Summary) -> Result<(), FolderError> {
        let root = self.scratch.path();
        let names = names(root)?;
        let found = ArchivedDataset::open(self.path)?;
        if found.is_finished() && found.holds_exactly(&names, root)? {
            return Ok(());
        }
        if found.is_damaged() {
            let kept = keep_damaged(self.path)?;
            summary.set_aside.push(kept.display().to_string());
        }
        let limbs = Planned::read(root)?.part(read_part(root)?);
        let mut written: Vec<String> = vec![DESCRIPTION_FILE.into(), PART_FILE.into()];
        let mut poses = Vec::new();
        for pose_job in limbs.iter().flat_map(LimbJobs::pose_jobs) {
            let record = Record::read(root, &pose_job)?;
            written.extend(record.files.iter().map(|row| row.file.clone()));
            written.push(pose_job.id().record_file());
            poses.push((pose_job.id(), record));
        }
        written.sort_unstable();
        let rest = names.into_iter();
        let rest = rest.filter(|name| written.binary_search(name).is_err());
        write_archive(
            self.path,
            &statements(root)?,
            poses
                .iter()
                .map(|(id, record)| Ok(files_of(root, *id, record)?)),
            || rest.map(|name| Ok(named(root, name)?)).collect(),
        )
    }
}

impl JobError {
    /// Reports the path of the archive instead of the temporary folder.
    pub(crate) fn of_archive(mut self, run: &ArchivedRun) -> Self {
        match &mut self {
            Self::DiskLimit { root, .. } | Self::Folder(FolderError::OtherPart { root, .. }) => {
                *root = run.path.to_owned();
            }
            Self::Folder(FolderError::Differs(differs)) => differs.root = run.path.to_owned(),
            _ => {}
        }
        self
    }
}

/// The files of a pose: images, then the record.
fn files_of(root: &Path, pose: PoseId, record: &Record) -> Result<Vec<NamedBytes>, FileError> {
    let images = record.files.iter().map(|row| row.file.clone());
    let files = images.chain([pose.record_file()]);
    files.map(|file| named(root, file)).collect()
}

fn named(root: &Path, file: String) -> Result<NamedBytes, FileError> {
    let path = root.join(&file);
    let bytes = fs::read(&path).map_err(FileError::at("read", &path))?;
    Ok((file, bytes))
}

/// The files that state which dataset a folder is for.
fn statements(root: &Path) -> Result<Vec<NamedBytes>, FileError> {
    let files = [DESCRIPTION_FILE, PART_FILE].into_iter();
    let files = files.filter(|file| root.join(file).exists());
    files.map(|file| named(root, file.to_owned())).collect()
}

/// Paths of all files of a dataset, except the lock and staged files.
fn names(root: &Path) -> Result<Vec<String>, FileError> {
    let mut names = Vec::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        if folder == staging_folder(root) {
            continue;
        }
        for entry in fs::read_dir(&folder).map_err(FileError::at("read", &folder))? {
            let path = entry.map_err(FileError::at("read", &folder))?.path();
            if path.is_dir() {
                folders.push(path);
            } else if let Ok(below) = path.strip_prefix(root) {
                names.push(below.to_string_lossy().into_owned());
            }
        }
    }
    names.retain(|name| *name != format!("{FOLDER}/lock"));
    Ok(names)
}
