//! Folders of a dataset and the names in them.

use std::fs;
use std::path::{Path, PathBuf};

use super::{Layout, PublishedError};
use crate::files::FileError;
use crate::layout::Side;

/// A folder of a dataset, on disk and as a path from the root.
pub(super) struct Folder {
    pub path: PathBuf,
    pub name: String,
}

impl Folder {
    pub fn new(root: &Path, name: &str) -> Self {
        Self {
            path: root.join(name),
            name: name.to_owned(),
        }
    }

    pub fn below(&self, name: &str) -> Self {
        Self {
            path: self.path.join(name),
            name: format!("{}/{name}", self.name),
        }
    }

    /// Sorted names of the folders (`true`) or files in it, except hidden ones; empty if it is missing.
    fn names(&self, folders: bool) -> Result<Vec<String>, FileError> {
        let mut names = Vec::new();
        if !fs::exists(&self.path).map_err(FileError::at("read", &self.path))? {
            return Ok(names);
        }
        for entry in fs::read_dir(&self.path).map_err(FileError::at("read", &self.path))? {
            let entry = entry.map_err(FileError::at("read", &self.path))?;
            let name = entry.file_name().to_string_lossy().into_owned();
            if !name.starts_with('.') && entry.path().is_dir() == folders {
                names.push(name);
            }
        }
        names.sort();
        Ok(names)
    }

    pub fn folders(&self) -> Result<Vec<String>, FileError> {
        self.names(true)
    }

    pub fn images(&self) -> Result<Vec<String>, FileError> {
        let mut names = self.names(false)?;
        names.retain(|name| name.to_ascii_lowercase().ends_with(".png"));
        Ok(names)
    }
}

/// Folder of a person, or of a limb in the specimen layout.
pub(super) struct Subject {
    pub name: String,
    pub patient: u32,
    pub side: Option<Side>,
}

/// The subjects of a dataset, all of one layout.
pub(super) struct Subjects {
    pub layout: Layout,
    pub folders: Vec<Subject>,
}

const EXPECTED: &str =
    "patient_N, patient_N_l or patient_N_r with N a number without leading zeros";

pub(super) fn subjects(root: &Path) -> Result<Subjects, PublishedError> {
    let of_root = Folder {
        path: root.to_owned(),
        name: String::new(),
    };
    // Otherwise a missing root would read as an empty one.
    fs::read_dir(root).map_err(FileError::at("read", root))?;
    let names = of_root.folders()?;
    let mut folders = Vec::new();
    for name in names.iter().filter(|name| name.starts_with("patient_")) {
        let path = || root.join(name);
        let expected = EXPECTED;
        let subject = subject(name).ok_or_else(|| PublishedError::Name {
            path: path(),
            expected,
        })?;
        let usual = usual_name(&subject);
        if usual != *name {
            return Err(if names.contains(&usual) {
                PublishedError::SameSubject {
                    first: root.join(usual),
                    second: path(),
                }
            } else {
                PublishedError::Name {
                    path: path(),
                    expected,
                }
            });
        }
        folders.push(subject);
    }
    let of_layout = |specimen: bool| folders.iter().find(|s| s.side.is_some() == specimen);
    let layout = match (of_layout(false), of_layout(true)) {
        (Some(synthetic), Some(specimen)) => {
            return Err(PublishedError::TwoLayouts {
                specimen: root.join(&specimen.name),
                synthetic: root.join(&synthetic.name),
            });
        }
        (Some(_), None) => Layout::Synthetic,
        (None, Some(_)) => Layout::Specimen,
        (None, None) => return Err(PublishedError::NoSubjects(root.to_owned())),
    };
    Ok(Subjects { layout, folders })
}

fn subject(name: &str) -> Option<Subject> {
    let rest = name.strip_prefix("patient_")?;
    let (number, side) = match rest.split_once('_') {
        None => (rest, None),
        Some((number, letter)) => {
            let side = Side::ALL.into_iter().find(|side| side.letter() == letter)?;
            (number, Some(side))
        }
    };
    Some(Subject {
        name: name.to_owned(),
        patient: digits(number)?,
        side,
    })
}

fn usual_name(subject: &Subject) -> String {
    let side = subject.side.map(|side| format!("_{}", side.letter()));
    format!("patient_{}{}", subject.patient, side.unwrap_or_default())
}

/// Parses a number of digits only: `parse` would also accept a sign.
pub(super) fn digits<N: std::str::FromStr>(text: &str) -> Option<N> {
    let only_digits = text.bytes().all(|byte| byte.is_ascii_digit());
    only_digits.then(|| text.parse().ok())?
}
