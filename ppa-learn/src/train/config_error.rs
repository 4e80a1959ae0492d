//! Errors of configurations.

use std::path::PathBuf;

/// Error in a configuration.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// It is not TOML, or has missing or unknown keys.
    #[error("{}: {message}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// The error and its position.
        message: String,
    },
    /// An unknown preset.
    #[error("{}: unknown preset {found:?}; expected \"quick\", \"standard\" or \"paper\"", path.display())]
    Preset {
        /// The file.
        path: PathBuf,
        /// The name found.
        found: String,
    },
    /// It cannot be written as TOML, for example because a path is not UTF-8.
    #[error("the configuration cannot be written as TOML: {0}")]
    Write(String),
    /// A number out of range.
    #[error("{key} is {found}, expected {expected}")]
    Range {
        /// The key.
        key: &'static str,
        /// Its value.
        found: String,
        /// Range of valid values.
        expected: &'static str,
    },
}
