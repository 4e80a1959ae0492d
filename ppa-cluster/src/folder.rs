//! The folder of a submission, and the paths of its files.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use crate::error::FolderError;
use crate::submission::{PoseWork, Work};

/// The folder that `ppa submit` fills: `slurm/` with plan, scripts and logs; `shards/` and `dataset/`, `runs/` with training runs and
/// tables, or `parts/` with tallies.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ClusterFolder {
    root: PathBuf,
}

/// Lock held while a command submits jobs from a folder; released on drop or when the process dies.
#[derive(Debug)]
pub struct FolderLock(#[expect(dead_code, reason = "holds the lock")] fs::File);

impl ClusterFolder {
    /// Creates the folder, or opens an empty one or one started by `ppa submit`. The parent folder must exist.
    ///
    /// # Errors
    /// [`FolderError`] if the parent folder is missing, or if the folder cannot be written or holds something else.
    pub fn create(root: &Path) -> Result<Self, FolderError> {
        let parent = match root.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        if !root.is_dir() {
            if !parent.is_dir() {
                return Err(FolderError::NoParent {
                    path: root.to_owned(),
                    parent: parent.to_owned(),
                });
            }
            fs::create_dir(root).map_err(FolderError::at("create", root))?;
        }
        let folder = Self::canonical(root)?;
        let mut entries = fs::read_dir(root).map_err(FolderError::at("read", root))?;
        if entries.next().is_some() && !folder.slurm().is_dir() {
            return Err(FolderError::Occupied(root.to_owned()));
        }
        let logs = folder.logs();
        fs::create_dir_all(&logs).map_err(FolderError::at("create", &logs))?;
        Ok(folder)
    }

    /// Creates the folder that the tasks write into.
    ///
    /// # Errors
    /// [`FolderError::File`].
    pub fn create_results(&self, work: &Work) -> Result<(), FolderError> {
        let made = match work {
            Work::Poses(_) => self.root.join("shards"),
            Work::Trainings(_) => self.runs(),
            Work::Histories(_) => self.root.join(PARTS),
        };
        fs::create_dir_all(&made).map_err(FolderError::at("create", &made))
    }

    /// Opens a folder that jobs were submitted from.
    ///
    /// # Errors
    /// [`FolderError::NotSubmitted`] for any other folder.
    pub fn open(root: &Path) -> Result<Self, FolderError> {
        if !Self::is_one(root) {
            return Err(FolderError::NotSubmitted(root.to_owned()));
        }
        Self::canonical(root)
    }

    /// Whether jobs were submitted from a folder, or their scripts written into it.
    pub fn is_one(root: &Path) -> bool {
        root.join("slurm/submission.json").is_file()
    }

    fn canonical(root: &Path) -> Result<Self, FolderError> {
        let root = root.canonicalize().map_err(FolderError::at("find", root))?;
        crate::quote::unicode(&root)?;
        Ok(Self { root })
    }

    /// Keeps other processes from submitting jobs from this folder.
    ///
    /// # Errors
    /// [`FolderError::Busy`] while another process holds it.
    pub fn lock(&self) -> Result<FolderLock, FolderError> {
        let path = self.slurm().join("lock");
        let mut options = fs::OpenOptions::new();
        let options = options.write(true).create(true).truncate(false);
        let file = options
            .open(&path)
            .map_err(FolderError::at("create", &path))?;
        match file.try_lock() {
            Ok(()) => Ok(FolderLock(file)),
            Err(fs::TryLockError::WouldBlock) => Err(FolderError::Busy(self.root.clone())),
            Err(fs::TryLockError::Error(error)) => Err(FolderError::at("lock", &path)(error)),
        }
    }

    /// Absolute path of the folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Folder of plan, scripts, logs and `submission.json`.
    pub fn slurm(&self) -> PathBuf {
        self.root.join("slurm")
    }

    /// The plan that the jobs read.
    pub fn plan(&self) -> PathBuf {
        self.slurm().join("plan.toml")
    }

    /// The script of the array, which makes a shard, a training run or a part.
    pub fn task_script(&self, work: &Work) -> PathBuf {
        self.slurm().join(format!("{}.sh", work.task_name()))
    }

    /// The script of the last job, which merges or writes the tables.
    pub fn last_script(&self, work: &Work) -> PathBuf {
        self.slurm().join(format!("{}.sh", work.last_name()))
    }

    /// File with the settings and task division of the submission.
    pub fn submission(&self) -> PathBuf {
        self.slurm().join("submission.json")
    }

    /// Folder of all job logs.
    pub fn logs(&self) -> PathBuf {
        self.slurm().join("logs")
    }

    /// The log of the last job.
    pub fn last_log(&self, work: &Work) -> PathBuf {
        self.logs().join(format!("{}.log", work.last_name()))
    }

    /// The folder or archive of a shard, counted from 1.
    pub fn shard(&self, work: &PoseWork, number: u64) -> PathBuf {
        let ending = work.ending();
        self.root.join("shards").join(format!("{number}{ending}"))
    }

    /// The folder of the tallies of a part, counted from 1.
    pub fn part(&self, number: u64) -> PathBuf {
        self.root.join(PARTS).join(number.to_string())
    }

    /// The folder or archive of the merged dataset.
    pub fn dataset(&self, work: &PoseWork) -> PathBuf {
        self.root.join(format!("dataset{}", work.ending()))
    }

    /// Folder of the training runs and tables of experiments.
    pub fn runs(&self) -> PathBuf {
        self.root.join("runs")
    }

    /// Whether a training run is finished, given its folder relative to [`ClusterFolder::runs`].
    pub fn is_trained(&self, training: &str) -> bool {
        self.runs().join(training).join(FINISHED).is_file()
    }

    /// Whether a training run was started.
    pub fn is_begun(&self, training: &str) -> bool {
        self.runs().join(training).is_dir()
    }

    /// Whether the last job has finished: the merged dataset is verified, or tables or images are written.
    ///
    /// # Errors
    /// [`FolderError::File`] if the file cannot be queried.
    pub fn is_done(&self) -> Result<bool, FolderError> {
        let path = self.root.join(DONE);
        match path.metadata() {
            Ok(_) => Ok(true),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
            Err(error) => Err(FolderError::at("read", &path)(error)),
        }
    }

    /// Name shared by all jobs of the folder and unique to it.
    pub fn job_name(&self) -> String {
        let hash = Sha256::digest(self.root.as_os_str().as_encoded_bytes());
        let digits: String = hash[..6].iter().map(|byte| format!("{byte:02x}")).collect();
        format!("ppa-{digits}")
    }
}

/// File, relative to the folder, that the last job writes after it has verified a dataset or written tables or images.
pub(crate) const DONE: &str = "slurm/verified";

/// The folder of the parts, relative to the job folder.
pub(crate) const PARTS: &str = "parts";

/// The tally of a part of a radiograph, relative to the folder of the part.
pub(crate) const TALLY: &str = "radiograph.tally";

/// File that marks a finished training run; `ppa experiment` writes it last.
pub(crate) const FINISHED: &str = "finished.json";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_below_a_missing_one_is_refused() {
        let above = tempfile::tempdir().unwrap();
        let root = above.path().join("nowhere/jobs");
        let said = ClusterFolder::create(&root).unwrap_err().to_string();
        assert!(said.contains("nowhere does not exist"), "{said}");
        assert!(!above.path().join("nowhere").exists());
    }

    #[test]
    fn a_folder_with_other_files_is_refused() {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join("notes.txt"), "kept").unwrap();
        let said = ClusterFolder::create(root.path()).unwrap_err().to_string();
        assert!(said.contains("neither empty nor"), "{said}");
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_folder_is_locked_by_one_process() {
        let root = tempfile::tempdir().unwrap();
        let folder = ClusterFolder::create(root.path()).unwrap();
        let lock = folder.lock().unwrap();
        assert!(matches!(folder.lock(), Err(FolderError::Busy(_))));
        drop(lock);
        folder.lock().unwrap();
        assert!(matches!(
            ClusterFolder::open(root.path()),
            Err(FolderError::NotSubmitted(_))
        ));
    }

    #[test]
    fn the_name_of_jobs_follows_from_the_folder() {
        let name = |root: &str| ClusterFolder { root: root.into() }.job_name();
        assert_eq!(name("/a b"), name("/a b"));
        assert_ne!(name("/a b"), name("/a"));
        assert_eq!(name("/a b").len(), 16);
    }
}
