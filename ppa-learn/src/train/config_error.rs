//! Why a configuration is not valid.

use std::path::PathBuf;

/// A configuration that cannot be.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// It is not TOML, or has missing or unknown keys.
    #[error("{}: {message}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// What and where.
        message: String,
    },
    /// No such preset.
    #[error("{}: unknown preset {found:?}; expected \"quick\", \"standard\" or \"paper\"", path.display())]
    Preset {
        /// The file.
        path: PathBuf,
        /// What stands there.
        found: String,
    },
    /// It cannot be written as TOML, as with a path that is not UTF-8.
    #[error("the configuration cannot be written as TOML: {0}")]
    Write(String),
    /// A number out of range.
    #[error("{key} is {found}, expected {expected}")]
    Range {
        /// The key.
        key: &'static str,
        /// Its value.
        found: String,
        /// What it could be.
        expected: &'static str,
    },
}
