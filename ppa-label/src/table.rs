//! Tables of rows with a header line, as CSV.

use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use ppa_dataset::files::{FileError, write_whole};

/// Why a file is not the expected table.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The columns or a cell are wrong.
    #[error("{} is not the expected table", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// What is wrong and where.
        source: csv::Error,
    },
}

pub(super) fn read_table<T: DeserializeOwned>(path: &Path) -> Result<Vec<T>, TableError> {
    let bytes = ppa_core::regular_file::read(path).map_err(FileError::at("read", path))?;
    let rows = csv::Reader::from_reader(&bytes[..]).into_deserialize();
    rows.collect::<Result<_, _>>()
        .map_err(|source| TableError::Parse {
            path: path.to_owned(),
            source,
        })
}

pub(super) fn write_table<T: Serialize>(path: &Path, rows: &[T]) -> Result<(), FileError> {
    write_whole(path, &table_bytes(rows))
}

/// The bytes of a table.
pub(super) fn table_bytes<T: Serialize>(rows: &[T]) -> Vec<u8> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.serialize(row).expect("rows are flat");
    }
    writer.into_inner().expect("memory takes every row")
}
