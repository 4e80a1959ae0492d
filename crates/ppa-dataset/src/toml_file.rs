//! Case, plan and room files as TOML.

use std::io;
use std::path::Path;

use serde::Serialize;

use crate::files::FileError;

/// What a file at `path` is to hold, as TOML; refuses paths that are not UTF-8.
pub(crate) fn to_toml<T: Serialize>(value: &T, path: &Path) -> Result<String, FileError> {
    toml::to_string(value).map_err(|e| FileError::at("write", path)(io::Error::other(e)))
}

/// The format version of a TOML file, if it is not 1; its other keys may then be any.
pub(crate) fn other_version(text: &str) -> Option<u32> {
    #[derive(serde::Deserialize)]
    struct Versioned {
        version: u32,
    }
    let versioned: Versioned = toml::from_str(text).ok()?;
    (versioned.version != 1).then_some(versioned.version)
}
