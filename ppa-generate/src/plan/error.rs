//! Why a plan cannot be used.

use std::path::PathBuf;

use ppa_dataset::files::FileError;

/// Why a plan cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// The file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is not a plan.
    #[error("{} is not a plan: {message}", path.display())]
    Parse {
        /// The plan file.
        path: PathBuf,
        /// What is wrong and where.
        message: String,
    },
    /// The file is of another format version.
    #[error("{} has plan version {found}; this program reads version 1", path.display())]
    Version {
        /// The plan file.
        path: PathBuf,
        /// Its version.
        found: u32,
    },
    /// Its HU calibration cannot be used.
    #[error(transparent)]
    Calibration(#[from] ppa_xray::CalibrationError),
    /// Its camera rig cannot be used.
    #[error(transparent)]
    Rig(#[from] ppa_depth::RigError),
    /// A value of the plan is invalid.
    #[error("{}: {message}", path.display())]
    Invalid {
        /// The plan file.
        path: PathBuf,
        /// What is wrong, and what was expected.
        message: String,
    },
}
