//! Record of the parameters that a training run did not take unchanged from its `start` file.

use std::path::{Path, PathBuf};

use ppa_dataset::write_whole;

use super::error::{TrainError, at};
use crate::weights::Loaded;

fn path(folder: &Path) -> PathBuf {
    folder.join("start.json")
}

/// Writes `start.json` into a run's folder.
pub(super) fn write(folder: &Path, loaded: &Loaded) -> Result<(), TrainError> {
    let json = serde_json::to_string_pretty(loaded).expect("names are JSON");
    Ok(write_whole(&path(folder), json.as_bytes())?)
}

/// Reads what the training run in a folder did not take unchanged from its `start` file; `None` if there is no `start.json`.
///
/// # Errors
/// [`TrainError::File`] if `start.json` exists but cannot be read.
pub fn read_start(folder: &Path) -> Result<Option<Loaded>, TrainError> {
    let path = path(folder);
    if !path.exists() {
        return Ok(None);
    }
    let text = ppa_core::regular_file::read_to_string(&path).map_err(at("read", &path))?;
    let loaded = serde_json::from_str(&text).map_err(std::io::Error::from);
    Ok(Some(loaded.map_err(at("read", &path))?))
}
