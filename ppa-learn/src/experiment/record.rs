//! Record of a finished training, to check that it is still the one asked for.

use std::path::Path;

use ppa_dataset::FileError;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::error::ExperimentError;
use crate::data::Sample;
use crate::train::TrainConfig;

/// What a finished training was: its settings without paths, and what it began with and saw.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    pub config: TrainConfig,
    pub start_sha256: Option<String>,
    pub data_sha256: String,
}

/// The settings that the results of a training depend on.
pub fn without_paths(config: &TrainConfig) -> TrainConfig {
    TrainConfig {
        start: None,
        training: vec![],
        evaluation: vec![],
        ..config.of_results()
    }
}

/// A hash of what training and test sets hold, but not where they lie.
pub fn fingerprint(sets: &[Vec<Sample>; 2]) -> String {
    let mut hash = Sha256::new();
    for set in sets {
        for sample in set {
            let regions: Vec<_> = sample.images.iter().map(|image| image.roi).collect();
            hash.update(format!("{} {} {regions:?}\n", sample.id, sample.label));
        }
        hash.update("end\n");
    }
    hash.finalize()
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
}

/// Reads a JSON file.
pub fn read_json<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T, ExperimentError> {
    let text = ppa_core::regular_file::read_to_string(path).map_err(file("read", path))?;
    serde_json::from_str(&text).map_err(|error| ExperimentError::Unreadable {
        path: path.to_owned(),
        message: error.to_string(),
    })
}

/// Names the file and what was done to it.
pub fn file<'a>(
    action: &'static str,
    path: &'a Path,
) -> impl FnOnce(std::io::Error) -> FileError + 'a {
    move |source| FileError {
        action,
        path: path.to_owned(),
        source,
    }
}
