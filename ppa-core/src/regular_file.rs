//! Reading of regular files only.
//!
//! Opening a named pipe blocks until somebody writes to it, and a device such as `/dev/zero` never ends. Every file that a
//! user or another file names is therefore opened here. Symbolic links are followed.

use std::fs::{File, FileType, Metadata, OpenOptions};
use std::io::{self, Read};
use std::path::Path;

/// Error for a path that is not a regular file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotRegular {
    /// Kind of file found, such as `a named pipe`.
    pub found: &'static str,
}

impl std::fmt::Display for NotRegular {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "found {}, expected a regular file", self.found)
    }
}

impl std::error::Error for NotRegular {}

/// Opens a regular file for reading; never blocks on a named pipe.
///
/// # Errors
/// [`io::Error`] of the system; [`io::ErrorKind::IsADirectory`] for a folder; [`NotRegular`] inside an
/// [`io::ErrorKind::InvalidInput`] for pipes, devices and sockets.
pub fn open(path: impl AsRef<Path>) -> io::Result<File> {
    let path = path.as_ref();
    // Checked first: opening alone wakes the writer of a pipe and can rewind a tape.
    expect_regular(&std::fs::metadata(path)?)?;
    let file = without_blocking().open(path)?;
    // The file may have been replaced in between.
    expect_regular(&file.metadata()?)?;
    Ok(file)
}

/// Reads all bytes of a regular file.
///
/// # Errors
/// The same as [`open`], and [`io::ErrorKind::OutOfMemory`] if the bytes do not fit in memory.
pub fn read(path: impl AsRef<Path>) -> io::Result<Vec<u8>> {
    let mut file = open(path)?;
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(length(&file)?)?;
    file.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Reads a regular file of UTF-8 text.
///
/// # Errors
/// The same as [`read`], and [`io::ErrorKind::InvalidData`] for other text.
pub fn read_to_string(path: impl AsRef<Path>) -> io::Result<String> {
    let mut file = open(path)?;
    let mut text = String::new();
    text.try_reserve_exact(length(&file)?)?;
    file.read_to_string(&mut text)?;
    Ok(text)
}

fn length(file: &File) -> io::Result<usize> {
    Ok(usize::try_from(file.metadata()?.len()).unwrap_or(usize::MAX))
}

fn expect_regular(metadata: &Metadata) -> io::Result<()> {
    if metadata.is_file() {
        return Ok(());
    }
    if metadata.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    let found = special(metadata.file_type());
    Err(io::Error::new(
        io::ErrorKind::InvalidInput,
        NotRegular { found },
    ))
}

#[cfg(unix)]
fn special(kind: FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    if kind.is_fifo() {
        "a named pipe"
    } else if kind.is_socket() {
        "a socket"
    } else {
        "a device"
    }
}

#[cfg(not(unix))]
fn special(_: FileType) -> &'static str {
    "something else"
}

#[cfg(unix)]
fn without_blocking() -> OpenOptions {
    use std::os::unix::fs::OpenOptionsExt;
    let mut options = OpenOptions::new();
    let flags = rustix::fs::OFlags::NONBLOCK.bits();
    options.read(true).custom_flags(flags.cast_signed());
    options
}

#[cfg(not(unix))]
fn without_blocking() -> OpenOptions {
    let mut options = OpenOptions::new();
    options.read(true);
    options
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn refused(path: &Path) -> String {
        let error = open(path).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidInput, "{error}");
        for error in [read(path).unwrap_err(), read_to_string(path).unwrap_err()] {
            assert_eq!(error.kind(), io::ErrorKind::InvalidInput, "{error}");
        }
        error.to_string()
    }

    #[test]
    fn pipes_devices_and_sockets_are_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        let mode = rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR;
        rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, mode).unwrap();
        let link = folder.path().join("link.nii");
        std::os::unix::fs::symlink(&pipe, &link).unwrap();
        for path in [&pipe, &link] {
            let found = "found a named pipe, expected a regular file";
            assert_eq!(refused(path), found);
        }
        assert!(refused(Path::new("/dev/zero")).contains("a device"));
        let socket = folder.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        assert!(refused(&socket).contains("a socket"));
    }

    #[test]
    fn regular_files_and_links_to_them_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "text").unwrap();
        let link = folder.path().join("link");
        std::os::unix::fs::symlink(&file, &link).unwrap();
        for path in [&file, &link] {
            assert_eq!(read(path).unwrap(), b"text");
            assert_eq!(read_to_string(path).unwrap(), "text");
        }
        std::fs::write(&file, [0xff]).unwrap();
        let error = read_to_string(&file).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidData);
    }

    #[test]
    fn folders_and_missing_files_are_told_apart() {
        let folder = tempfile::tempdir().unwrap();
        let kind = |path: &Path| open(path).unwrap_err().kind();
        assert_eq!(kind(folder.path()), io::ErrorKind::IsADirectory);
        assert_eq!(kind(&folder.path().join("none")), io::ErrorKind::NotFound);
    }
}
