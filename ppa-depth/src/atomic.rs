//! Files that appear whole or not at all.

use std::io::{self, BufWriter};
use std::path::Path;

use atomic_write_file::AtomicWriteFile;

/// Lets `write` fill a temporary file beside `path`, then syncs and renames it.
pub(crate) fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<AtomicWriteFile>) -> io::Result<()>,
) -> io::Result<()> {
    // Checked here, since a failed rename would leave the temporary file behind.
    if path.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    let mut writer = BufWriter::new(AtomicWriteFile::open(path)?);
    write(&mut writer)?;
    writer.into_inner().map_err(|e| e.into_error())?.commit()
}
