//! Errors of job folders and of Slurm.

use std::io;
use std::path::{Path, PathBuf};

/// Why a folder of jobs cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FolderError {
    /// A file system operation failed.
    #[error("cannot {action} {}", path.display())]
    File {
        /// `read`, `write`, `create` …
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
    /// The parent folder is missing.
    #[error("{} cannot be created: {} does not exist or is not a folder", path.display(), parent.display())]
    NoParent {
        /// The folder of jobs.
        path: PathBuf,
        /// The missing folder.
        parent: PathBuf,
    },
    /// The folder holds something else.
    #[error("{} is neither empty nor a folder of an earlier ppa submit; choose another folder", .0.display())]
    Occupied(PathBuf),
    /// No jobs were submitted from the folder.
    #[error("{} contains no slurm/submission.json: nothing was submitted from it", .0.display())]
    NotSubmitted(PathBuf),
    /// `submission.json` is damaged or of another version.
    #[error("{} is damaged or was written by another version of ppa: {found}", path.display())]
    Submission {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        found: String,
    },
    /// Another `ppa submit` is using the folder.
    #[error("{} is in use by another ppa submit; wait until it ends", .0.display())]
    Busy(PathBuf),
    /// The path cannot be used in a job script.
    #[error("{} is not valid UTF-8, which a job script needs", .0.display())]
    NotUnicode(PathBuf),
}

impl FolderError {
    /// Adds action and path to a system error, for `map_err`.
    pub(crate) fn at<'a>(
        action: &'static str,
        path: &'a Path,
    ) -> impl FnOnce(io::Error) -> Self + 'a {
        move |source| Self::File {
            action,
            path: path.to_owned(),
            source,
        }
    }
}

/// Why Slurm could not be queried, or why it refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SlurmError {
    /// A program of Slurm is not installed.
    #[error(
        "Slurm is not installed on this machine: {program} was not found in PATH; submit from a machine of the cluster, or \
         write the scripts with --dry-run"
    )]
    NotInstalled {
        /// `sbatch`, `squeue` …
        program: &'static str,
    },
    /// A program of Slurm could not be started.
    #[error("cannot run {program}")]
    Run {
        /// `sbatch`, `squeue` …
        program: &'static str,
        /// Error of the system.
        source: io::Error,
    },
    /// A program of Slurm failed.
    #[error("{program} failed: {said}")]
    Refused {
        /// `sbatch`, `squeue` …
        program: &'static str,
        /// The message of Slurm, in one line.
        said: String,
    },
    /// The output of Slurm does not have the expected form.
    #[error("{program} answered \"{found}\", expected {expected}")]
    Answer {
        /// `sbatch`, `squeue` …
        program: &'static str,
        /// The offending line.
        found: String,
        /// The expected form.
        expected: &'static str,
    },
    /// The configuration of Slurm does not state MaxArraySize.
    #[error("scontrol show config does not report MaxArraySize as a whole number: found {found}")]
    NoArraySize {
        /// Value found, or a note that the line is missing.
        found: String,
    },
    /// The cluster does not support job arrays.
    #[error("the cluster accepts no job arrays: its MaxArraySize is {found}, expected 2 or more")]
    NoArrays {
        /// MaxArraySize.
        found: u64,
    },
}
