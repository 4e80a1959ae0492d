//! Keeps a damaged archive next to the one that replaces it.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use ppa_dataset::files::FileError;

/// Keeps an archive under a second name, `*.damagedN`, and returns that name.
///
/// # Errors
/// [`FileError`] if it can be neither linked nor copied.
pub(crate) fn keep_damaged(path: &Path) -> Result<PathBuf, FileError> {
    let mut number = 1;
    loop {
        let mut name = path.as_os_str().to_owned();
        name.push(format!(".damaged{number}"));
        let kept = PathBuf::from(name);
        // Some file systems have no hard links.
        match fs::hard_link(path, &kept).or_else(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => Err(error),
            _ => copy(path, &kept),
        }) {
            Ok(()) => return Ok(kept),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => number += 1,
            Err(error) => return Err(FileError::at("write", &kept)(error)),
        }
    }
}

fn copy(from: &Path, to: &Path) -> io::Result<()> {
    let mut file = File::create_new(to)?;
    io::copy(&mut File::open(from)?, &mut file)?;
    file.sync_all()
}
