//! Folders written completely or not at all.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::files::FileError;

/// Fills a hidden folder next to `to` and renames it to `to` when it is finished.
///
/// Rejects an existing `to` unless it is an empty folder. If anything fails, nothing is left behind.
pub fn write_whole_folder<T, E: From<FileError>>(
    to: &Path,
    fill: impl FnOnce(&Path) -> Result<T, E>,
) -> Result<T, E> {
    if holds_something(to).map_err(FileError::at("read", to))? {
        let full = io::Error::other("it already exists and is not an empty folder");
        return Err(FileError::at("write", to)(full).into());
    }
    let unfinished = beside(to)?;
    let clear = || match fs::remove_dir_all(&unfinished) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    };
    clear().map_err(FileError::at("clear", &unfinished))?;
    fs::create_dir_all(&unfinished).map_err(FileError::at("create folder", &unfinished))?;
    let filled = fill(&unfinished).and_then(|filled| {
        sync(&unfinished)?;
        let renamed = fs::rename(&unfinished, to).map_err(FileError::at("write", to));
        renamed.map(|()| filled).map_err(E::from)
    });
    if filled.is_err() {
        // The first error counts.
        let _ = clear();
    }
    filled
}

/// Syncs all files below a folder to disk: after a power cut, no name may exist without its contents.
fn sync(folder: &Path) -> Result<(), FileError> {
    let entries = fs::read_dir(folder).and_then(Iterator::collect::<io::Result<Vec<_>>>);
    for entry in entries.map_err(FileError::at("read", folder))? {
        let path = entry.path();
        if path.is_dir() {
            sync(&path)?;
        } else {
            // A copied file keeps its mode, so a read-only one is opened for reading.
            let opened = fs::OpenOptions::new().append(true).open(&path);
            let opened = opened.or_else(|_| fs::File::open(&path));
            let synced = opened.and_then(|file| file.sync_all());
            synced.map_err(FileError::at("write", &path))?;
        }
    }
    Ok(())
}

fn holds_something(folder: &Path) -> io::Result<bool> {
    if folder.is_dir() {
        return Ok(fs::read_dir(folder)?.next().is_some());
    }
    fs::exists(folder)
}

fn beside(to: &Path) -> Result<PathBuf, FileError> {
    let name = to.file_name().ok_or_else(|| {
        FileError::at("write", to)(io::Error::other("the folder name is invalid"))
    })?;
    Ok(to.with_file_name(format!(".{}.unfinished", name.to_string_lossy())))
}
