//! One file per command.

pub mod calibrate;
pub mod cancel;
pub mod case;
pub mod completions;
pub mod ct;
pub mod dataset;
pub mod demo;
pub mod depth;
pub mod eval;
pub mod experiment;
pub mod export;
pub mod generate;
pub mod label;
pub mod learn;
pub mod man;
pub mod merge;
pub mod mesh;
pub mod metrics;
mod pictures;
pub mod plan;
pub mod predict;
pub mod prepare;
pub mod qa;
pub mod scene;
pub mod stats;
pub mod status;
#[cfg(feature = "studio")]
pub mod studio;
pub mod submit;
mod technique;
pub mod train;
pub mod verify;
pub mod xray;

use std::path::Path;

use anyhow::Context;
use serde::de::DeserializeOwned;

/// Reads the rows of a CSV file with a header line.
fn read_csv<T: DeserializeOwned>(path: &Path) -> anyhow::Result<Vec<T>> {
    // Read completely first: `csv` treats a header that cannot be read as an empty table.
    let bytes = ppa_core::regular_file::read(path)
        .with_context(|| format!("cannot read {}", path.display()))?;
    let rows = csv::Reader::from_reader(&bytes[..])
        .into_deserialize()
        .collect::<Result<_, _>>();
    rows.with_context(|| format!("{} is not the expected table", path.display()))
}

/// Reads a JSON file.
fn read_json<T: DeserializeOwned>(path: &Path) -> anyhow::Result<T> {
    let text = ppa_core::regular_file::read_to_string(path)
        .with_context(|| format!("cannot read {}", path.display()))?;
    serde_json::from_str(&text)
        .with_context(|| format!("{} is not the expected JSON", path.display()))
}
