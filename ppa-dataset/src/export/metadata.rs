//! Description of a dataset for search engines (Croissant) and archives (RO-Crate).

use std::collections::BTreeSet;
use std::path::Path;

use serde::Deserialize;
use sha2::{Digest, Sha256};

use super::croissant::croissant;
use super::datasheet::datasheet;
use super::ro_crate::ro_crate;
use super::table::{Table, TableError};
use crate::files::{FileError, hex, read_text, write_whole};
use crate::split::Split;

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

impl Metadata {
    /// Whether search engines and archives can use it; says what is wrong.
    fn check(&self) -> Result<(), String> {
        if self.name.trim().is_empty() {
            return Err("the name is empty".to_owned());
        }
        let address = ["https://", "http://"]
            .into_iter()
            .find_map(|scheme| self.license.strip_prefix(scheme));
        if address.is_none_or(|rest| rest.is_empty() || rest.contains(char::is_whitespace)) {
            return Err(format!(
                "the licence is {:?}, expected its address, https://…",
                self.license
            ));
        }
        if !is_day(&self.date) {
            return Err(format!(
                "the date is {:?}, expected a day as YYYY-MM-DD",
                self.date
            ));
        }
        Ok(())
    }
}

/// Whether a text is a day of the Gregorian calendar as `2026-11-21`.
fn is_day(text: &str) -> bool {
    let number = |part: &str, digits: usize| -> Option<u32> {
        let plain = part.len() == digits && part.bytes().all(|byte| byte.is_ascii_digit());
        plain.then(|| part.parse().ok())?
    };
    let [year, month, day] = text.split('-').collect::<Vec<_>>()[..] else {
        return false;
    };
    let (Some(year), Some(month), Some(day)) = (number(year, 4), number(month, 2), number(day, 2))
    else {
        return false;
    };
    let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let days = match month {
        2 if leap => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        1..=12 => 31,
        _ => 0,
    };
    (1..=days).contains(&day)
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

const DATASHEET: &str = "datasheet.md";

/// The datasheet where another one is there already, in which people may have answered.
const NEW_DATASHEET: &str = "datasheet.new.md";

/// Writes `manifest.csv`, `croissant.json` (Croissant 1.1), `ro-crate-metadata.json` (RO-Crate 1.1) and `datasheet.md` into the
/// dataset in `root`, each whole or not at all; `split` names the split that stands in the table. A datasheet that is there, in
/// which people may have answered, stays; one that differs is written beside it as `datasheet.new.md`. Names of the files written.
///
/// # Errors
/// [`TableError`] naming the file at fault, among them one that is there and differs without `replace`, or what of the metadata is no
/// name, address or day; nothing is written then.
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

/// Files beside the images, with their formats: labels, regions of interest, splits. Those that are not there are left out.
fn lists(root: &Path, table: &Table) -> Result<Vec<(String, &'static str)>, TableError> {
    let mut lists = Vec::new();
    for limb in table.limbs() {
        let regions = limb.roi_file();
        let folder = regions.trim_end_matches("roi_depth.json").to_owned();
        lists.push((regions, "application/json"));
        lists.push((folder.clone() + "labels.json", "application/json"));
        lists.push((folder.clone() + "labels.computed.json", "application/json"));
        lists.push((folder.clone() + "openness.csv", "text/csv"));
        lists.push((folder + "openness.json", "application/json"));
    }
    lists.retain(|(file, _)| root.join(file).is_file());
    for name in Split::names(root)? {
        lists.push((format!("splits/{name}.json"), "application/json"));
    }
    lists.push(("croissant.json".to_owned(), "application/ld+json"));
    lists.push((DATASHEET.to_owned(), "text/markdown"));
    Ok(lists)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_days_of_the_calendar_and_addresses_are_taken() {
        for day in ["2026-11-21", "2024-02-29", "2000-02-29", "0001-12-31"] {
            assert!(is_day(day), "{day}");
        }
        for other in [
            "2026-02-29",
            "1900-02-29",
            "2026-04-31",
            "2026-00-01",
            "2026-13-01",
            "2026-01-00",
            "+026-01-01",
            "2026-+1-+1",
            "2026-1-1",
            "2026-11",
            "2026-11-21-",
            "21.11.2026",
        ] {
            assert!(!is_day(other), "{other}");
        }
        let metadata = |name: &str, license: &str| Metadata {
            name: name.to_owned(),
            license: license.to_owned(),
            date: "2026-11-21".to_owned(),
        };
        let by = "https://creativecommons.org/licenses/by/4.0/";
        assert_eq!(metadata("ankles", by).check(), Ok(()));
        for (name, license, expected) in [
            (" ", by, "the name is empty"),
            ("ankles", "CC-BY", "the licence is \"CC-BY\""),
            ("ankles", "./", "the licence is"),
            ("ankles", "https://", "the licence is"),
        ] {
            let said = metadata(name, license).check().unwrap_err();
            assert!(said.contains(expected), "{said}");
        }
    }
}
