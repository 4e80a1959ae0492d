//! Files that appear whole or not at all.

use std::io::{BufWriter, Error, ErrorKind, Result};
use std::path::Path;

use atomic_write_file::AtomicWriteFile;

/// A file that does not stand under its name yet.
pub(crate) type Unfinished = BufWriter<AtomicWriteFile>;

/// Fills a temporary file beside `path`, synced and renamed when it is complete.
pub(crate) fn write_whole(
    path: &Path,
    fill: impl FnOnce(&mut Unfinished) -> Result<()>,
) -> Result<()> {
    // Checked here, since a failed rename would leave the temporary file behind.
    if path.is_dir() {
        return Err(ErrorKind::IsADirectory.into());
    }
    let mut file = BufWriter::new(AtomicWriteFile::open(path)?);
    fill(&mut file)?;
    file.into_inner().map_err(Error::from)?.commit()
}
