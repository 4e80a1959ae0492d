//! Comparison of a dataset with its `manifest.jsonl` and `dataset.json`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use ppa_core::text::error_chain;
use rayon::prelude::*;
use serde::Deserialize;

use super::outdated::outdated;
use super::{Flaw, Published, PublishedError};
use crate::checksums::{Checksums, FoundChecksums};
use crate::files::{FileError, read_text, sha256_of_file};
use crate::manifest::{FileKind, FileRow, Manifest};

/// All differences between the images and the lists, if there are lists. `hashes` are those of the images.
pub(super) fn against_lists(dataset: &Published, hashes: BTreeMap<&str, String>) -> Vec<Flaw> {
    let root = &dataset.root;
    let mut flaws = same_scans(root);
    flaws.extend(stale_metadata(root));
    flaws.extend(against_checksums(root, Checksums::FILE, |file| {
        Flaw::List { file }
    }));
    flaws.extend(against_checksums(root, Checksums::OF_LABELS, |file| {
        Flaw::Labels { file }
    }));
    if !root.join(Manifest::FILE).exists() {
        return flaws;
    }
    let manifest = match Manifest::read(root) {
        Ok(manifest) => manifest,
        Err(error) => {
            flaws.push(Flaw::Manifest(error_chain(&error)));
            return flaws;
        }
    };
    flaws.extend(against_manifest(&manifest, hashes));
    match outdated(dataset, None, || Ok(manifest)) {
        Err(error) => flaws.push(Flaw::Manifest(error_chain(&error))),
        Ok(found) => flaws.extend(found.into_iter().map(|outdated| Flaw::Outdated {
            limb: outdated.limb,
            step: outdated.steps[0],
            count: outdated.steps.len(),
        })),
    }
    flaws
}

/// Differences from a file of hashes, if there is one; `flaw` makes the flaw of a file with another hash.
fn against_checksums(root: &Path, sums: &'static str, flaw: impl Fn(String) -> Flaw) -> Vec<Flaw> {
    match Checksums::look_at(root, sums) {
        Err(error) => vec![Flaw::Manifest(error_chain(&error))],
        Ok(FoundChecksums::Absent) => Vec::new(),
        Ok(FoundChecksums::Damaged) => vec![Flaw::Checksums { file: sums }],
        Ok(FoundChecksums::Whole(sums)) => sums.altered(root).into_iter().map(flaw).collect(),
    }
}

fn against_manifest<'a>(
    manifest: &'a Manifest,
    mut hashes: BTreeMap<&'a str, String>,
) -> Vec<Flaw> {
    let is_tallies = |row: &&FileRow| row.kind == FileKind::RadiographTallies;
    let tallies: Vec<_> = manifest.files.iter().filter(is_tallies).collect();
    let of_tallies = tallies.par_iter().filter_map(|row| {
        let hash = sha256_of_file(&manifest.root.join(&row.file)).ok()?;
        Some((row.file.as_str(), hash))
    });
    let of_tallies: Vec<_> = of_tallies.collect();
    hashes.extend(of_tallies);
    let mut flaws = Vec::new();
    let mut listed = BTreeSet::new();
    for row in &manifest.files {
        let file = row.file.clone();
        if !listed.insert(row.file.as_str()) {
            flaws.push(Flaw::Unlisted {
                file,
                r#where: "listed twice in manifest.jsonl",
            });
            continue;
        }
        match hashes.get(row.file.as_str()) {
            None => flaws.push(Flaw::Unlisted {
                file,
                r#where: "listed in manifest.jsonl, but missing",
            }),
            Some(hash) if *hash != row.sha256 => flaws.push(Flaw::Altered {
                file,
                found: hash.clone(),
                expected: row.sha256.clone(),
            }),
            Some(_) => {}
        }
    }
    for file in hashes.keys().filter(|file| !listed.contains(*file)) {
        let file = (*file).to_owned();
        flaws.push(Flaw::Unlisted {
            file,
            r#where: "not listed in manifest.jsonl",
        });
    }
    flaws
}

/// The part of `dataset.json` that names scans.
#[derive(Deserialize)]
struct Scans {
    #[serde(default)]
    limbs: Vec<Scan>,
}

#[derive(Deserialize)]
struct Scan {
    patient: u32,
    volume_sha256: String,
}

/// Scans listed for two patients.
fn same_scans(root: &Path) -> Vec<Flaw> {
    let path = root.join("dataset.json");
    if !path.exists() {
        return Vec::new();
    }
    let read = || -> Result<Scans, PublishedError> {
        let parsed = serde_json::from_str(&read_text(&path)?);
        Ok(parsed.map_err(|e| FileError::at("parse", &path)(e.into()))?)
    };
    let scans = match read() {
        Ok(scans) => scans,
        Err(error) => return vec![Flaw::Manifest(error_chain(&error))],
    };
    let mut owners: BTreeMap<&str, u32> = BTreeMap::new();
    let mut flaws = Vec::new();
    for scan in &scans.limbs {
        let owner = *owners.entry(&scan.volume_sha256).or_insert(scan.patient);
        if owner != scan.patient {
            flaws.push(Flaw::SameScan {
                patients: [owner, scan.patient],
            });
        }
    }
    flaws
}

/// A flaw if `croissant.json` describes another table: programs would refuse to load it.
fn stale_metadata(root: &Path) -> Option<Flaw> {
    let [metadata, table] = ["croissant.json", "manifest.csv"].map(|name| root.join(name));
    if !metadata.exists() {
        return None;
    }
    let text = read_text(&metadata).ok()?;
    let described: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
    let distribution = described["distribution"].as_array();
    let table_is = |file: &&serde_json::Value| file["@id"] == "manifest.csv";
    let expected = distribution.and_then(|files| files.iter().find(table_is));
    let found = sha256_of_file(&table).ok();
    let same =
        found.is_some() && expected.and_then(|file| file["sha256"].as_str()) == found.as_deref();
    let report = "croissant.json describes a manifest.csv that has since changed: run ppa export metadata again";
    (!same).then(|| Flaw::Metadata(report.to_owned()))
}
