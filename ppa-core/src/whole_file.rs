//! Files that are written completely or not at all.

use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use atomic_write_file::AtomicWriteFile;

/// A file being written next to its final path.
#[derive(Debug)]
pub struct Unfinished(BufWriter<AtomicWriteFile>);

impl Write for Unfinished {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

impl Seek for Unfinished {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.0.seek(to)
    }
}

/// Lets `fill` write a temporary file next to `path`, which is then synced and renamed. Until then, a previous file at `path` stays valid.
///
/// # Errors
/// [`io::Error`] of the system or of `fill`; [`io::ErrorKind::IsADirectory`] for a folder. Nothing is left behind.
pub fn write_with(
    path: impl AsRef<Path>,
    fill: impl FnOnce(&mut Unfinished) -> io::Result<()>,
) -> io::Result<()> {
    let path = path.as_ref();
    // Checked here, since a failed rename would leave the temporary file behind.
    if path.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    let mut file = Unfinished(BufWriter::new(AtomicWriteFile::open(path)?));
    fill(&mut file)?;
    file.0.into_inner().map_err(io::Error::from)?.commit()
}

/// The same as [`write_with`] for bytes already in memory.
///
/// # Errors
/// The same as [`write_with`].
pub fn write(path: impl AsRef<Path>, bytes: &[u8]) -> io::Result<()> {
    write_with(path, |file| file.write_all(bytes))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        write(&path, b"old").unwrap();
        let failed = write_with(&path, |file| {
            file.write_all(b"new")?;
            Err(io::ErrorKind::StorageFull.into())
        });
        assert_eq!(failed.unwrap_err().kind(), io::ErrorKind::StorageFull);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        write(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
    }

    #[test]
    fn a_folder_is_refused_without_a_trace() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("folder");
        fs::create_dir(&path).unwrap();
        let error = write(&path, b"bytes").unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::IsADirectory);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
