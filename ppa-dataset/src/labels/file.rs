//! `labels.json`: the quality of every radiograph of a limb, in the published layout.

use std::collections::{BTreeMap, HashMap};
use std::fmt;
use std::path::{Path, PathBuf};

use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::label::{LabelError, LabelRow, LabelSource, Sources, name_of, radiograph_name};
use super::name::LabelName;
use crate::files::{FileError, read_text, write_whole};
use crate::layout::LimbId;
use crate::manifest::{FileKind, Manifest};

/// Why `labels.json` cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LabelFileError {
    /// The file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is not a valid label file.
    #[error("{} is not a valid label file: {message}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// What is wrong and where.
        message: String,
    },
}

/// The labels of one limb's radiographs.
///
/// A radiograph has one label: that of readers if there is one, otherwise a computed one. All computed labels are also kept in a
/// file of their own, [`LabelFile::computed_path`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LabelFile {
    /// By file name of the radiograph, `xray_image_STEP.png`.
    rows: BTreeMap<String, Labelled>,
}

/// A label, its source, and the hash of its radiograph, as far as they are known.
#[derive(Debug, Clone, PartialEq)]
struct Labelled {
    row: LabelRow,
    source: Option<LabelSource>,
    sha256: Option<String>,
}

impl LabelFile {
    /// Path of `labels.json`, next to the regions of interest.
    pub fn path(root: &Path, limb: LimbId) -> PathBuf {
        root.join(limb.roi_file()).with_file_name("labels.json")
    }

    /// Path of the computed labels, including those that readers' labels replace in [`LabelFile::path`].
    pub fn computed_path(root: &Path, limb: LimbId) -> PathBuf {
        root.join(limb.roi_file())
            .with_file_name("labels.computed.json")
    }

    /// Path of the labels with a given name, next to [`LabelFile::path`]; that path itself if there is no name.
    pub fn named_path(root: &Path, limb: LimbId, name: Option<&LabelName>) -> PathBuf {
        Self::path(root, limb).with_file_name(Self::file_name(name))
    }

    /// File name of the labels with a given name; `labels.json` if there is none.
    pub fn file_name(name: Option<&LabelName>) -> String {
        name.map_or("labels.json".to_owned(), |name| {
            format!("labels.{name}.json")
        })
    }

    /// Builds a file of labels of one source, given in any order.
    ///
    /// # Errors
    /// [`LabelError`] for labels outside 1 to 3, spreads outside 0 to 1, and steps beyond 360.
    pub fn new(
        source: LabelSource,
        labels: impl IntoIterator<Item = LabelRow>,
    ) -> Result<Self, LabelError> {
        Self::with_sources(labels.into_iter().map(|row| (row, Some(source))))
    }

    /// Builds a file of labels with their sources, given in any order.
    pub(crate) fn with_sources(
        labels: impl IntoIterator<Item = (LabelRow, Option<LabelSource>)>,
    ) -> Result<Self, LabelError> {
        let named = labels.into_iter().map(|(row, source)| {
            let image = radiograph_name(row.step);
            row.check(&image)?;
            let labelled = Labelled {
                row,
                source,
                sha256: None,
            };
            Ok((image, labelled))
        });
        Ok(Self {
            rows: named.collect::<Result<_, _>>()?,
        })
    }

    /// Source of the label of a step; `None` if there is no label, or if the file does not state its source, as in the published ones.
    pub fn source_of_step(&self, step: u32) -> Option<LabelSource> {
        self.rows.get(&radiograph_name(step))?.source
    }

    /// Labels by step, lowest first.
    pub fn labels(&self) -> Vec<LabelRow> {
        let mut rows: Vec<_> = self.rows.values().map(|labelled| labelled.row).collect();
        rows.sort_unstable_by_key(|row| row.step);
        rows
    }

    /// The label of a step.
    pub fn of_step(&self, step: u32) -> Option<&LabelRow> {
        let labelled = self.rows.get(&radiograph_name(step))?;
        Some(&labelled.row)
    }

    /// The same labels, with the hashes of their radiographs in the manifest.
    #[must_use]
    pub fn of_radiographs(mut self, manifest: &Manifest, limb: LimbId) -> Self {
        let hashes = radiograph_hashes(manifest, limb);
        for labelled in self.rows.values_mut() {
            let hash = hashes.get(&labelled.row.step);
            labelled.sha256 = hash.map(|hash| (*hash).to_owned());
        }
        self
    }

    /// Returns only the computed labels.
    pub fn computed(&self) -> Self {
        self.only(|source| source.is_some_and(LabelSource::is_computed))
    }

    /// Returns the other labels: readers', and those without a source.
    pub fn not_computed(&self) -> Self {
        self.only(|source| !source.is_some_and(LabelSource::is_computed))
    }

    fn only(&self, keep: impl Fn(Option<LabelSource>) -> bool) -> Self {
        let rows = self.rows.iter();
        let rows = rows.filter(|(_, labelled)| keep(labelled.source));
        Self {
            rows: rows
                .map(|(image, labelled)| (image.clone(), labelled.clone()))
                .collect(),
        }
    }

    /// These labels, and those of `others` for radiographs without a label here.
    pub fn over(self, others: &Self) -> Self {
        let mut rows = others.rows.clone();
        rows.extend(self.rows);
        Self { rows }
    }

    /// Whether any label has no source.
    pub fn has_unnamed(&self) -> bool {
        self.rows.values().any(|labelled| labelled.source.is_none())
    }

    /// Whether any label has the hash of its radiograph.
    pub fn is_bound(&self) -> bool {
        self.rows.values().any(|labelled| labelled.sha256.is_some())
    }

    /// Steps whose radiograph is no longer the one that was labelled, lowest first. Labels without a hash, such as the published
    /// ones, are never outdated.
    pub fn outdated(&self, manifest: &Manifest, limb: LimbId) -> Vec<u32> {
        let hashes = radiograph_hashes(manifest, limb);
        let other = |labelled: &&Labelled| {
            let now = hashes.get(&labelled.row.step).copied();
            labelled.sha256.is_some() && labelled.sha256.as_deref() != now
        };
        let steps = self.rows.values().filter(other);
        let mut steps: Vec<_> = steps.map(|labelled| labelled.row.step).collect();
        steps.sort_unstable();
        steps
    }

    /// Reads `labels.json` of a limb; `None` if there is none.
    ///
    /// # Errors
    /// [`LabelFileError`] naming the file and the radiograph at fault: labels outside 1 to 3, angles off the grid of half
    /// degrees from 0 to 180, a radiograph listed twice, labels of incompatible sources.
    pub fn read(root: &Path, limb: LimbId) -> Result<Option<Self>, LabelFileError> {
        Self::read_file(Self::path(root, limb))
    }

    /// Reads the computed labels of a limb; `None` if there is no file of them.
    pub fn read_computed(root: &Path, limb: LimbId) -> Result<Option<Self>, LabelFileError> {
        Self::read_file(Self::computed_path(root, limb))
    }

    /// Reads the labels with a given name, `labels.json` if there is none; `None` if their file does not exist.
    ///
    /// # Errors
    /// The same as [`LabelFile::read`].
    pub fn read_named(
        root: &Path,
        limb: LimbId,
        name: Option<&LabelName>,
    ) -> Result<Option<Self>, LabelFileError> {
        Self::read_file(Self::named_path(root, limb, name))
    }

    fn read_file(path: PathBuf) -> Result<Option<Self>, LabelFileError> {
        if !path.try_exists().map_err(FileError::at("read", &path))? {
            return Ok(None);
        }
        let found = serde_json::from_str(&read_text(&path)?);
        found.map(Some).map_err(|error| LabelFileError::Parse {
            message: error.to_string(),
            path,
        })
    }

    /// Writes `labels.json` of a limb, completely or not at all.
    ///
    /// # Errors
    /// [`FileError`] when it cannot be written.
    pub fn write(&self, root: &Path, limb: LimbId) -> Result<(), FileError> {
        write_whole(&Self::path(root, limb), self.to_text().as_bytes())
    }

    /// The bytes of the file.
    pub fn to_text(&self) -> String {
        serde_json::to_string_pretty(self).expect("labels are finite numbers")
    }
}

/// Hashes of a limb's radiographs by step.
fn radiograph_hashes(manifest: &Manifest, limb: LimbId) -> HashMap<u32, &str> {
    let radiographs = manifest
        .files
        .iter()
        .filter(|row| row.kind == FileKind::Radiograph && row.limb == limb);
    radiographs
        .map(|row| (row.step, row.sha256.as_str()))
        .collect()
}

/// A label as stored in the file.
#[derive(Serialize, Deserialize)]
struct Entry {
    #[serde(flatten)]
    row: LabelRow,
    /// Source of the label; left out if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    label_source: Option<LabelSource>,
    /// SHA-256 of the radiograph that was labelled.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    radiograph_sha256: Option<String>,
}

impl Serialize for LabelFile {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let entry = |labelled: &Labelled| Entry {
            row: labelled.row,
            label_source: labelled.source,
            radiograph_sha256: labelled.sha256.clone(),
        };
        let rows = self.rows.iter();
        serializer.collect_map(rows.map(|(image, labelled)| (image, entry(labelled))))
    }
}

impl<'de> Deserialize<'de> for LabelFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Rows)
    }
}

/// Reads row by row, since a map would keep only the last of two rows with the same name.
struct Rows;

impl<'de> Visitor<'de> for Rows {
    type Value = LabelFile;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("labels by name of the radiograph")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<LabelFile, A::Error> {
        let mut sources = Sources::default();
        let mut rows = BTreeMap::new();
        while let Some((image, entry)) = map.next_entry::<String, Entry>()? {
            entry.row.check(&image).map_err(A::Error::custom)?;
            if let Err(expected) = sources.take(entry.label_source) {
                return Err(A::Error::custom(LabelError::Mixed {
                    found: name_of(entry.label_source),
                    expected,
                    image,
                }));
            }
            if rows.contains_key(&image) {
                return Err(A::Error::custom(format!("{image} is listed twice")));
            }
            let labelled = Labelled {
                row: entry.row,
                source: entry.label_source,
                sha256: entry.radiograph_sha256,
            };
            rows.insert(image, labelled);
        }
        Ok(LabelFile { rows })
    }
}

#[cfg(test)]
mod tests;
