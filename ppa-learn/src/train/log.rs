//! The scalars of a training run, one line of JSON per row.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use ppa_dataset::{FileError, write_whole};
use serde::{Deserialize, Deserializer, Serialize};

use super::error::{TrainError, at};

/// Measurements after a step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LogRow {
    /// Number of steps made.
    pub step: u64,
    /// Training time so far in seconds, including the time before interruptions.
    pub seconds: f64,
    /// Values by TensorBoard's tags; NaN for values that JSON cannot represent.
    #[serde(flatten, deserialize_with = "null_is_nan")]
    pub scalars: BTreeMap<String, f64>,
}

fn null_is_nan<'de, D: Deserializer<'de>>(row: D) -> Result<BTreeMap<String, f64>, D::Error> {
    let values = BTreeMap::<String, Option<f64>>::deserialize(row)?.into_iter();
    Ok(values
        .map(|(tag, x)| (tag, x.unwrap_or(f64::NAN)))
        .collect())
}

/// Reads the rows of a log, up to a line truncated by a crash.
///
/// # Errors
/// [`FileError`] if the log exists but cannot be read.
pub fn read_log(path: &Path) -> Result<Vec<LogRow>, FileError> {
    if !path.exists() {
        return Ok(Vec::new());
    }
    let text = ppa_core::regular_file::read_to_string(path).map_err(at("read", path))?;
    let rows = text
        .lines()
        .map_while(|line| serde_json::from_str(line).ok());
    Ok(rows.collect())
}

/// A log that is being written.
pub(super) struct Log {
    path: PathBuf,
    file: File,
    /// All rows so far.
    pub rows: Vec<LogRow>,
}

impl Log {
    /// Continues a log after `step` and removes later rows.
    pub fn resume(path: &Path, step: u64) -> Result<Self, TrainError> {
        let mut rows = read_log(path)?;
        rows.retain(|row| row.step <= step);
        let lines: String = rows.iter().map(line).collect();
        write_whole(path, lines.as_bytes())?;
        let file = OpenOptions::new().append(true).open(path);
        Ok(Self {
            path: path.to_owned(),
            file: file.map_err(at("write", path))?,
            rows,
        })
    }

    /// Adds a row.
    pub fn push(&mut self, row: LogRow) -> Result<(), TrainError> {
        let written = self.file.write_all(line(&row).as_bytes());
        written.map_err(at("write", &self.path))?;
        self.rows.push(row);
        Ok(())
    }
}

fn line(row: &LogRow) -> String {
    let json = serde_json::to_string(row).expect("numbers by name are JSON");
    json + "\n"
}
