//! What a dataset is, told to search engines (Croissant) and archives (RO-Crate).

use std::collections::BTreeSet;
use std::path::Path;

use serde::Deserialize;
use sha2::{Digest, Sha256};

use super::croissant::croissant;
use super::ro_crate::ro_crate;
use super::table::{Table, TableError};
use crate::files::{FileError, hex, read_text, write_whole};

/// What no program can know about a dataset.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Metadata {
    /// Its name.
    pub name: String,
    /// Address of its licence, as `https://creativecommons.org/licenses/by/4.0/`.
    pub license: String,
    /// Day of publication, as `2026-11-21`.
    pub date: String,
}

/// What `dataset.json` says of where the images come from.
#[derive(Deserialize)]
pub(super) struct Provenance {
    pub settings: Generator,
    pub limbs: Vec<Scan>,
}

#[derive(Deserialize)]
pub(super) struct Generator {
    /// Program and version.
    pub generator: String,
    /// Hash of its sources.
    pub code: String,
}

#[derive(Deserialize)]
pub(super) struct Scan {
    pub patient: u32,
    pub side: String,
    pub volume_sha256: String,
}

impl Provenance {
    /// Hashes of the scans, each once.
    pub fn scans(&self) -> BTreeSet<&str> {
        self.limbs
            .iter()
            .map(|limb| limb.volume_sha256.as_str())
            .collect()
    }
}

/// What both formats say of every dataset.
pub(super) const DESCRIPTION: &str = "Depth images that two Time-of-Flight cameras on an x-ray device would see of a limb lying \
    on the table, and the radiograph of the same pose, simulated from computed tomography for many rotations of the limb and several body shapes. \
    Depth images: 16-bit PNG, Z in mm, 0 invalid. Radiographs: 16-bit PNG for viewing, EXR with tallies in eV/cm2 per history.";

/// The method.
pub(super) const PAPER: &str = "https://doi.org/10.59275/j.melba.2026-c874";

/// Table that the metadata describe.
pub(super) const TABLE: &str = "manifest.csv";

/// Writes `manifest.csv`, `croissant.json` (Croissant 1.1) and `ro-crate-metadata.json` (RO-Crate 1.1) into the dataset in
/// `root`, each whole or not at all; `split` names the split that stands in the table.
///
/// # Errors
/// [`TableError`] naming the file at fault.
pub fn write_metadata(
    root: &Path,
    metadata: &Metadata,
    split: Option<&str>,
) -> Result<(), TableError> {
    let table = Table::of_dataset(root, split)?;
    let path = root.join("dataset.json");
    let provenance: Provenance = serde_json::from_str(&read_text(&path)?)
        .map_err(|e| FileError::at("parse", &path)(e.into()))?;
    let csv = table.to_csv();
    let sha256 = hex(&Sha256::digest(&csv));
    let croissant = croissant(metadata, &table, &sha256, &provenance);
    let ro_crate = ro_crate(metadata, &table, &provenance);
    for (name, bytes) in [
        (TABLE, csv),
        ("croissant.json", format!("{croissant:#}\n").into_bytes()),
        (
            "ro-crate-metadata.json",
            format!("{ro_crate:#}\n").into_bytes(),
        ),
    ] {
        write_whole(&root.join(name), &bytes)?;
    }
    Ok(())
}
