//! The archive of a complete dataset: the same bytes for the same dataset, however it was made.

use std::io::{self, Write};
use std::path::Path;

use ppa_core::whole_file;
use ppa_dataset::archive::ArchiveWriter;
use ppa_dataset::files::FileError;
use ppa_dataset::manifest::Manifest;

/// Path and bytes of a file.
pub(crate) type NamedBytes = (String, Vec<u8>);

/// Writes an archive whole or not at all: `dataset.json` and `.ppa/part` as given, images and record of each pose, and the files that
/// `rest` returns after the last pose, by name, with the manifest last, since it marks a complete dataset.
pub(crate) fn write_archive<E: From<FileError>>(
    path: &Path,
    stated: &[NamedBytes],
    poses: impl Iterator<Item = Result<Vec<NamedBytes>, E>>,
    rest: impl FnOnce() -> Result<Vec<NamedBytes>, E>,
) -> Result<(), E> {
    let mut failed = None;
    let written = whole_file::write_with(path, |file| {
        fill(file, stated, poses, rest).map_err(|error| match error {
            Failure::Write(error) => error,
            Failure::Read(error) => {
                failed = Some(error);
                io::ErrorKind::Other.into()
            }
        })
    });
    match (failed, written) {
        (Some(error), _) => Err(error),
        (None, written) => Ok(written.map_err(FileError::at("write", path))?),
    }
}

enum Failure<E> {
    Read(E),
    Write(io::Error),
}

fn fill<E>(
    file: impl Write,
    stated: &[NamedBytes],
    poses: impl Iterator<Item = Result<Vec<NamedBytes>, E>>,
    rest: impl FnOnce() -> Result<Vec<NamedBytes>, E>,
) -> Result<(), Failure<E>> {
    let mut archive = ArchiveWriter::new(file);
    let mut add = |files: &[NamedBytes]| {
        let mut files = files.iter();
        files
            .try_for_each(|(name, bytes)| archive.add(name, bytes))
            .map_err(Failure::Write)
    };
    add(stated)?;
    for files in poses {
        add(&files.map_err(Failure::Read)?)?;
    }
    let mut rest = rest().map_err(Failure::Read)?;
    rest.sort_by(|(a, _), (b, _)| {
        let is_last = |name: &str| name == Manifest::FILE;
        (is_last(a), a).cmp(&(is_last(b), b))
    });
    add(&rest)?;
    archive.finish().map(drop).map_err(Failure::Write)
}
