//! Errors of thresholds.

use std::path::PathBuf;

use ppa_dataset::files::FileError;

use super::name::ScaleName;

/// Why the thresholds of a scale cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScaleError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file contains no thresholds of the scale.
    #[error("{} holds no thresholds of the {scale} scale: {message}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// The scale.
        scale: ScaleName,
        /// What is wrong.
        message: String,
    },
    /// Thresholds of openness that do not decrease.
    #[error("thresholds of openness are {}, expected four decreasing numbers from 0 to 1", ppa_core::text::numbers(*.0))]
    Falling([f64; 4]),
    /// Thresholds of hidden parts that do not increase.
    #[error("{key} is {}, expected four increasing numbers from 0 to {most}", ppa_core::text::numbers(*found))]
    Rising {
        /// The key.
        key: &'static str,
        /// Its numbers.
        found: [f64; 4],
        /// The largest number allowed.
        most: f64,
    },
}
