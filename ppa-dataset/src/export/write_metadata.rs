//! Description of a dataset for search engines (Croissant) and archives (RO-Crate).

use std::io::ErrorKind;
use std::path::Path;

use sha2::{Digest, Sha256};

use super::croissant::croissant;
use super::datasheet::datasheet;
use super::metadata::{Metadata, Provenance, TABLE};
use super::ro_crate::ro_crate;
use super::table::{Table, TableError};
use crate::files::{FileError, hex, read_text, write_whole};
use crate::split::Split;

const DATASHEET: &str = "datasheet.md";

/// File for the datasheet if a different one exists already, in which people may have answered.
const NEW_DATASHEET: &str = "datasheet.new.md";

/// Writes `manifest.csv`, `croissant.json` (Croissant 1.1), `ro-crate-metadata.json` (RO-Crate 1.1) and `datasheet.md` into the
/// dataset in `root`, each completely or not at all; `split` names the split listed in the table. Keeps an existing datasheet, which
/// people may have filled in, and writes a new one that differs as `datasheet.new.md`. Returns the names of the files written.
///
/// # Errors
/// [`TableError`] naming the file at fault, for example an existing one that differs while `replace` is not set, or the invalid name,
/// address or date in the metadata; nothing is written in that case.
pub fn write_metadata(
    root: &Path,
    metadata: &Metadata,
    split: Option<&str>,
    replace: bool,
) -> Result<[&'static str; 4], TableError> {
    metadata.check().map_err(TableError::Metadata)?;
    let table = Table::of_dataset(root, split)?;
    let path = root.join("dataset.json");
    let provenance: Provenance = serde_json::from_str(&read_text(&path)?)
        .map_err(|e| FileError::at("parse", &path)(e.into()))?;
    let csv = table.to_csv();
    let sha256 = hex(&Sha256::digest(&csv));
    let croissant = croissant(metadata, &table, &sha256, &provenance);
    let lists = lists(root, &table)?;
    let ro_crate = ro_crate(metadata, &table, &lists, &provenance);
    let datasheet = datasheet(metadata, &table, &Split::names(root)?, &provenance);
    let there = root.join(DATASHEET);
    let is_another = there.exists() && read_text(&there)? != datasheet;
    let sheet = if is_another { NEW_DATASHEET } else { DATASHEET };
    let files = [
        (TABLE, csv),
        ("croissant.json", format!("{croissant:#}\n").into_bytes()),
        (
            "ro-crate-metadata.json",
            format!("{ro_crate:#}\n").into_bytes(),
        ),
        (sheet, datasheet.into_bytes()),
    ];
    for (name, bytes) in &files {
        let path = root.join(name);
        let differs = || std::fs::read(&path).map(|found| found != *bytes);
        if !replace && path.exists() && differs().map_err(FileError::at("read", &path))? {
            return Err(TableError::Differs(path));
        }
    }
    for (name, bytes) in &files {
        write_whole(&root.join(name), bytes)?;
    }
    Ok(files.map(|(name, _)| name))
}

/// A limb's labels and the data they were computed from, by name: `labels*.json`, `openness*.csv` and `openness*.json`.
fn labels(root: &Path, folder: &str) -> Result<Vec<(String, &'static str)>, FileError> {
    let path = root.join(folder);
    let entries = match std::fs::read_dir(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(FileError::at("read", &path))?,
    };
    let mut found = Vec::new();
    for entry in entries {
        let name = entry.map_err(FileError::at("read", &path))?.file_name();
        let name = name.to_string_lossy();
        let format = match name.split_once('.') {
            Some(("labels" | "openness", rest)) if rest.ends_with("json") => "application/json",
            Some(("openness", rest)) if rest.ends_with("csv") => "text/csv",
            _ => continue,
        };
        found.push((format!("{folder}{name}"), format));
    }
    found.sort();
    Ok(found)
}

/// Files other than the images, with their formats: labels, regions of interest, splits. Missing ones are left out.
fn lists(root: &Path, table: &Table) -> Result<Vec<(String, &'static str)>, TableError> {
    let mut lists = Vec::new();
    for limb in table.limbs() {
        let regions = limb.roi_file();
        let folder = regions.trim_end_matches("roi_depth.json").to_owned();
        lists.extend(labels(root, &folder)?);
        lists.push((regions, "application/json"));
    }
    lists.retain(|(file, _)| root.join(file).is_file());
    for name in Split::names(root)? {
        lists.push((format!("splits/{name}.json"), "application/json"));
    }
    lists.push(("croissant.json".to_owned(), "application/ld+json"));
    lists.push((DATASHEET.to_owned(), "text/markdown"));
    Ok(lists)
}
