//! Files written completely or not at all, and their hashes.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use ppa_core::{regular_file, whole_file};
use sha2::{Digest, Sha256};

/// A file could not be read or written.
#[derive(Debug, thiserror::Error)]
#[error("cannot {action} {}", path.display())]
pub struct FileError {
    /// `read`, `write`, `create folder` …
    pub action: &'static str,
    /// The file at fault.
    pub path: PathBuf,
    /// The error of the system.
    pub source: io::Error,
}

impl FileError {
    /// Adds action and path to an error of the system, for `map_err`.
    pub fn at<'a>(action: &'static str, path: &'a Path) -> impl FnOnce(io::Error) -> Self + 'a {
        move |source| Self {
            action,
            path: path.to_owned(),
            source,
        }
    }
}

/// Writes a file through a temporary file in the same folder, which is synced and then renamed.
///
/// # Errors
/// [`FileError`] when the folder cannot be created or the file cannot be written; nothing is left behind.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    fs::create_dir_all(folder).map_err(FileError::at("create folder", folder))?;
    whole_file::write(path, bytes).map_err(FileError::at("write", path))
}

/// Removes a file if it exists.
pub fn remove_if_there(path: &Path) -> Result<(), FileError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(FileError::at("remove", path)(error))
        }
        _ => Ok(()),
    }
}

/// Reads a text file.
pub fn read_text(path: &Path) -> Result<String, FileError> {
    regular_file::read_to_string(path).map_err(FileError::at("read", path))
}

/// SHA-256 of a file's bytes as lower-case hexadecimal.
///
/// # Errors
/// [`FileError`] when the file cannot be read.
pub fn sha256_of_file(path: &Path) -> Result<String, FileError> {
    let bytes = regular_file::read(path).map_err(FileError::at("read", path))?;
    Ok(hex(&Sha256::digest(bytes)))
}

/// Bytes as lower-case hexadecimal.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
