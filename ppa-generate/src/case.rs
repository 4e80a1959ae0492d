//! `case.toml`: every preprocessing decision for one limb of one CT.

use std::path::{Path, PathBuf};

use ppa_ct::{ReadOptions, SeriesChoice};
use ppa_dataset::files::{FileError, read_text, write_whole};
use ppa_dataset::findings::{Finding, FindingCode};
use ppa_mesh::{LimbReport, LimbSettings};
use ppa_scene::{LandmarkOverrides, Landmarks, Side};
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};

use crate::toml_edits::with_keys;
use crate::toml_file::{other_version, relative_to, to_toml};
use ppa_dataset::labels::BoneFile;

/// One limb of one CT. `ppa prepare` proposes it; a person changes `side`, `surface` and `choices`, and everything else is recomputed when
/// the case is used.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Case {
    /// Format of this file; 1.
    pub version: u32,
    /// Left or right limb.
    pub side: Side,
    /// Codes of findings that a person has looked at and accepts.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub acknowledged: Vec<FindingCode>,
    /// The scan.
    pub source: Source,
    /// How the skin is found and separated from the couch.
    pub surface: LimbSettings,
    /// Landmarks chosen by a person; those left out are determined again.
    pub choices: LandmarkOverrides,
    /// Bone label of each voxel, for computed labels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bones: Option<BoneFile>,
    /// What was derived from the other keys when the case was written; `None` for a case that was read, since a person may have edited it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub found: Option<Found>,
}

/// A case as stored in a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CaseFile {
    version: u32,
    side: Side,
    #[serde(default)]
    acknowledged: Vec<FindingCode>,
    source: Source,
    surface: LimbSettings,
    choices: LandmarkOverrides,
    #[serde(default)]
    bones: Option<BoneFile>,
    #[serde(default, rename = "found")]
    _found: IgnoredAny,
}

/// The scan a case was made from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// DICOM folder or NIfTI file; a relative path is resolved against the folder of the case file.
    pub path: PathBuf,
    /// SHA-256 over size, affine and Hounsfield units of the volume: the scan's identity.
    pub volume_sha256: String,
    /// Number of the DICOM series, if the folder holds several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub series: Option<i32>,
    /// Whether gaps between slices are interpolated.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub fill_gaps: bool,
    /// Whether modalities other than CT and values not in HU are read.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub force: bool,
}

impl Source {
    /// How to read the scan.
    pub fn reading(&self) -> ReadOptions {
        ReadOptions {
            series: self.series.map(SeriesChoice::Number),
            fill_gaps: self.fill_gaps,
            force: self.force,
        }
    }
}

/// Results of the preparation, recorded for a person to read.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Found {
    /// Findings about the scan and the limb.
    pub findings: Vec<Finding>,
    /// Axis, joint and plane in the ct frame, mm.
    pub landmarks: Landmarks,
    /// What was cut away to isolate the skin.
    pub surface: LimbReport,
}

/// Why a case cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaseError {
    /// The file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is not a case.
    #[error("{} is not a case: {message}", path.display())]
    Parse {
        /// The case file.
        path: PathBuf,
        /// What is wrong and where.
        message: String,
    },
    /// The file is of another format version.
    #[error("{} has case version {found}; this program reads version 1", path.display())]
    Version {
        /// The case file.
        path: PathBuf,
        /// Its version.
        found: u32,
    },
}

impl Case {
    /// Reads a case; the paths of its scan and bones become relative to the current folder.
    ///
    /// # Errors
    /// [`CaseError`] naming the file and the line or key at fault.
    pub fn read(path: &Path) -> Result<Self, CaseError> {
        let text = read_text(path)?;
        if let Some(found) = other_version(&text) {
            let path = path.to_owned();
            return Err(CaseError::Version { path, found });
        }
        let case: CaseFile = toml::from_str(&text).map_err(|error| CaseError::Parse {
            path: path.to_owned(),
            message: error.to_string().trim_end().to_owned(),
        })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Ok(Self {
            version: case.version,
            side: case.side,
            acknowledged: case.acknowledged,
            source: Source {
                path: folder.join(&case.source.path),
                ..case.source
            },
            surface: case.surface,
            choices: case.choices,
            bones: case.bones.map(|bones| BoneFile {
                path: folder.join(&bones.path),
                ..bones
            }),
            found: None,
        })
    }

    /// Writes the case, whole or not at all.
    ///
    /// Relative paths of scan and bones are rewritten to start at the case file's folder.
    ///
    /// # Errors
    /// [`CaseError::File`], also for a scan path that is not UTF-8, which TOML cannot hold.
    pub fn write(&self, path: &Path) -> Result<(), CaseError> {
        let text = with_open_choices(self.keys(path)?, self);
        Ok(write_whole(path, format!("{HEADER}{text}").as_bytes())?)
    }

    /// Writes the case as [`Self::write`] does, but starts from the text of an earlier version and keeps its comments.
    ///
    /// # Errors
    /// The same as [`Self::write`], and [`CaseError::Parse`] if the earlier version is not TOML.
    pub fn write_edited(&self, earlier: &str, path: &Path) -> Result<(), CaseError> {
        let edited = with_keys(&without_open_choices(earlier), &self.keys(path)?);
        let edited = edited.map_err(|error| CaseError::Parse {
            path: path.to_owned(),
            message: error.to_string().trim_end().to_owned(),
        })?;
        Ok(write_whole(
            path,
            with_open_choices(edited, self).as_bytes(),
        )?)
    }

    /// All keys and values, in a file at `path`.
    fn keys(&self, path: &Path) -> Result<String, CaseError> {
        let mut case = self.clone();
        let folder = path.parent().unwrap_or(Path::new(""));
        case.source.path = relative_to(&case.source.path, folder)?;
        if let Some(bones) = &mut case.bones {
            bones.path = relative_to(&bones.path, folder)?;
        }
        Ok(to_toml(&case, path)?)
    }
}

/// A case's text without the lines that [`with_open_choices`] added.
fn without_open_choices(text: &str) -> String {
    let Some((before, after)) = text.split_once(OPEN_CHOICES) else {
        return text.to_owned();
    };
    let added = |line: &&str| line.starts_with('#') && line.contains(" = ");
    let kept = after.split_inclusive('\n').skip_while(added);
    before.chars().chain(kept.flat_map(str::chars)).collect()
}

/// Adds to `[choices]` the keys that a person may still choose, commented out, with the values that were found.
fn with_open_choices(mut text: String, case: &Case) -> String {
    const TABLE: &str = "\n[choices]\n";
    let (Some(found), Some(table)) = (&case.found, text.find(TABLE)) else {
        return text;
    };
    let begin = table + TABLE.len();
    let end = text[begin - 1..]
        .find("\n[")
        .map_or(text.len(), |end| begin - 1 + end);
    let open = found.landmarks.open_choices(&case.choices);
    let keys = toml::to_string(&open).unwrap_or_default();
    let lines: String = keys.lines().map(|line| format!("#{line}\n")).collect();
    text.insert_str(end, &format!("{OPEN_CHOICES}{lines}"));
    text
}

const OPEN_CHOICES: &str = "\
# A line below shows what was found: remove its # and change the value to choose it; the rest is found again
# to fit it. axis stands instead of the regions and axis_source.
";

const HEADER: &str = "\
# One limb of one CT, prepared for ppa. Lengths in mm, positions in the scan's LPS frame.
# Change `side`, [surface] or [choices]. [choices] holds what a person chose; everything else is found.
# [found] shows what followed; it is computed again whenever the case is used. Its severe findings are repeated
# by every command until `acknowledged` names their codes.

";
