//! Record of a finished training run, to check that it still matches the plan.

use std::path::Path;

use ppa_dataset::FileError;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::error::ExperimentError;
use crate::data::Sample;
use crate::train::TrainConfig;

/// Record of a finished training run: its settings without paths, and hashes of its initial weights and data.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    pub config: TrainConfig,
    pub start_sha256: Option<String>,
    pub data_sha256: String,
}

/// Returns the settings on which the results of a training run depend.
pub fn without_paths(config: &TrainConfig) -> TrainConfig {
    TrainConfig {
        start: None,
        training: vec![],
        evaluation: vec![],
        ..config.of_results()
    }
}

/// Returns a hash of the content of the training and test sets, independent of their location.
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

/// Returns a function that adds the action and the file to an I/O error.
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
