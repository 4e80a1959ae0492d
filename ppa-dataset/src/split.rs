//! Persons for training and persons for testing: `splits/*.json`.
//!
//! A split is by person, never by image or foot: poses of one foot are alike, and so are the two feet of a person.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::checksums::Checksums;
use crate::files::{FileError, read_text, write_whole};

/// Folder of the splits inside a dataset.
const FOLDER: &str = "splits";

/// Persons by name of their part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Split {
    /// Format of this file; 1.
    pub version: u32,
    /// Seed that the persons were drawn with; absent if somebody chose them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// N of `patient_N` for each part, such as `train`, `val`, `test`.
    pub parts: BTreeMap<String, Vec<u32>>,
}

/// Why a split cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SplitError {
    /// The file cannot be read or written, or is not a split.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is of another format version.
    #[error("the split has version {0}; this program reads version 1")]
    Version(u32),
    /// A person in two parts: a model would be tested on persons it was trained on.
    #[error("patient {patient} is in {first} and in {second}: a person must be in one part only")]
    Leak {
        /// The person.
        patient: u32,
        /// A part.
        first: String,
        /// Another part, or the same one again.
        second: String,
    },
    /// A person of the dataset in no part.
    #[error("patient {0} is not in any part of the split")]
    Unassigned(u32),
    /// A person that is not in the dataset.
    #[error("patient {patient} of part {part} is not in the dataset")]
    Unknown {
        /// The person.
        patient: u32,
        /// Its part.
        part: String,
    },
    /// A part whose name is not a valid file name on every system.
    #[error("the name of a part is {0:?}, expected letters, digits, _ and -, not beginning with -")]
    Name(String),
    /// Shares that cannot be drawn.
    #[error("{0}")]
    Shares(String),
}

impl Split {
    /// Draws the persons of each part. Shares are taken relative to their sum and rounded to whole persons, the largest
    /// remainder first; a seed gives two persons the same relative order regardless of the others.
    ///
    /// # Errors
    /// [`SplitError::Shares`] for shares that are not positive, a name given twice, or a part that would be empty.
    pub fn draw(patients: &[u32], shares: &[(String, f64)], seed: u64) -> Result<Self, SplitError> {
        shares.iter().try_for_each(|(name, _)| check_name(name))?;
        let counts = counts(patients.len(), shares)?;
        let mut order: Vec<_> = patients.iter().map(|&p| (draw(seed, p), p)).collect();
        order.sort_unstable();
        order.dedup();
        let mut order = order.into_iter().map(|(_, patient)| patient);
        let mut parts = BTreeMap::new();
        for ((name, _), count) in shares.iter().zip(counts) {
            let mut part: Vec<_> = order.by_ref().take(count).collect();
            part.sort_unstable();
            parts.insert(name.clone(), part);
        }
        Ok(Self {
            version: 1,
            seed: Some(seed),
            parts,
        })
    }

    /// Reads a split.
    ///
    /// # Errors
    /// [`SplitError`], including a person in two parts.
    pub fn read(path: &Path) -> Result<Self, SplitError> {
        let parsed = serde_json::from_str(&read_text(path)?);
        let split: Self = parsed.map_err(|e| FileError::at("parse", path)(e.into()))?;
        if split.version != 1 {
            return Err(SplitError::Version(split.version));
        }
        split.parts.keys().try_for_each(|name| check_name(name))?;
        split.by_patient()?;
        Ok(split)
    }

    /// Writes the split to [`Split::path`], completely or not at all, and its hash to `labels.sha256`.
    ///
    /// # Errors
    /// [`FileError`] when it cannot be written.
    pub fn write(&self, root: &Path, name: &str) -> Result<(), FileError> {
        let path = Self::path(root, name);
        write_whole(&path, self.to_text().as_bytes())?;
        Checksums::record_labels(root, &[path])
    }

    /// The bytes of the file.
    pub fn to_text(&self) -> String {
        let text = serde_json::to_string_pretty(self).expect("splits hold only JSON values");
        format!("{text}\n")
    }

    /// The file of a split in a dataset: `splits/NAME.json`.
    pub fn path(root: &Path, name: &str) -> PathBuf {
        root.join(FOLDER).join(format!("{name}.json"))
    }

    /// Names of the splits in a dataset, sorted.
    ///
    /// # Errors
    /// [`FileError`] when their folder cannot be read.
    pub fn names(root: &Path) -> Result<Vec<String>, FileError> {
        let folder = root.join(FOLDER);
        let entries = match fs::read_dir(&folder) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            entries => entries.map_err(FileError::at("read", &folder))?,
        };
        let mut names = Vec::new();
        for entry in entries {
            let file = entry.map_err(FileError::at("read", &folder))?.file_name();
            let file = file.to_string_lossy();
            if let Some(name) = file
                .strip_suffix(".json")
                .filter(|name| !name.starts_with('.'))
            {
                names.push(name.to_owned());
            }
        }
        names.sort();
        Ok(names)
    }

    /// The part that a person is in.
    pub fn part_of(&self, patient: u32) -> Option<&str> {
        let mut parts = self.parts.iter();
        let (name, _) = parts.find(|(_, patients)| patients.contains(&patient))?;
        Some(name)
    }

    /// Checks that every person of a dataset is in exactly one part, and that the parts hold no other persons.
    ///
    /// # Errors
    /// [`SplitError`] naming the person at fault.
    pub fn check(&self, patients: &[u32]) -> Result<(), SplitError> {
        let by_patient = self.by_patient()?;
        if let Some(&patient) = patients.iter().find(|&p| !by_patient.contains_key(p)) {
            return Err(SplitError::Unassigned(patient));
        }
        match by_patient
            .into_iter()
            .find(|(patient, _)| !patients.contains(patient))
        {
            None => Ok(()),
            Some((patient, part)) => Err(SplitError::Unknown {
                patient,
                part: part.to_owned(),
            }),
        }
    }

    fn by_patient(&self) -> Result<BTreeMap<u32, &str>, SplitError> {
        let mut parts = BTreeMap::new();
        for (part, patients) in &self.parts {
            for &patient in patients {
                if let Some(first) = parts.insert(patient, part.as_str()) {
                    return Err(SplitError::Leak {
                        patient,
                        first: first.to_owned(),
                        second: part.clone(),
                    });
                }
            }
        }
        Ok(parts)
    }
}

/// Archives are named after parts: a name must not lead out of their folder or look like an option or a formula.
fn check_name(name: &str) -> Result<(), SplitError> {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    match !name.is_empty() && !name.starts_with('-') && name.chars().all(plain) {
        true => Ok(()),
        false => Err(SplitError::Name(name.to_owned())),
    }
}

/// Sort key of a person for a seed.
fn draw(seed: u64, patient: u32) -> [u8; 32] {
    Sha256::digest(format!("{seed}/split/{patient}").as_bytes()).into()
}

/// Number of persons in each part.
fn counts(patients: usize, shares: &[(String, f64)]) -> Result<Vec<usize>, SplitError> {
    let wrong = |text: String| Err(SplitError::Shares(text));
    for (i, (name, share)) in shares.iter().enumerate() {
        if !(share.is_finite() && *share > 0.0) {
            return wrong(format!(
                "the share of {name} is {share}, expected a number above 0"
            ));
        }
        if shares[..i].iter().any(|(other, _)| other == name) {
            return wrong(format!("the part {name} is given twice"));
        }
    }
    let sum: f64 = shares.iter().map(|(_, share)| share).sum();
    let exact: Vec<_> = shares
        .iter()
        .map(|(_, share)| share / sum * patients as f64)
        .collect();
    let mut counts: Vec<_> = exact.iter().map(|e| e.floor() as usize).collect();
    let mut order: Vec<_> = (0..shares.len()).collect();
    order.sort_by(|&a, &b| exact[b].fract().total_cmp(&exact[a].fract()));
    let left = patients.saturating_sub(counts.iter().sum());
    for &i in order.iter().take(left) {
        counts[i] += 1;
    }
    match counts.iter().position(|&count| count == 0) {
        None if !counts.is_empty() => Ok(counts),
        None => wrong("no part to draw".to_owned()),
        Some(i) => wrong(format!(
            "with {} the part {} is empty; give it a larger share or use fewer parts",
            ppa_core::text::count(patients, "person"),
            shares[i].0
        )),
    }
}

#[cfg(test)]
mod tests;
