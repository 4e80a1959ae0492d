//! A DICOMDIR and the files that it lists (DICOM PS3.3, annex F).

use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};

use dicom_dictionary_std::tags;

use super::element::DataSet;
use super::file::{damaged, text};
use crate::error::ReadError;

/// The files listed in a directory.
#[derive(Debug, Default)]
pub(super) struct Listed {
    /// Files that exist.
    pub files: BTreeSet<PathBuf>,
    /// Number of missing files.
    pub missing: usize,
}

/// Reads the records of the directory at `path`.
///
/// # Errors
/// [`ReadError::BadTag`] for a file that is outside the directory's folder, by its name or by a link.
pub(super) fn listed(path: &Path, data_set: &DataSet) -> Result<Listed, ReadError> {
    let io = |path: &Path, source| ReadError::Io {
        path: path.to_owned(),
        source,
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let real = match folder.as_os_str().is_empty() {
        true => Path::new(".").canonicalize(),
        false => folder.canonicalize(),
    };
    let real = real.map_err(|e| io(folder, e))?;
    let records = data_set.items(tags::DIRECTORY_RECORD_SEQUENCE);
    let mut listed = Listed::default();
    for record in records.map_err(|fault| damaged(path, fault))? {
        let Some(id) = record.get(tags::REFERENCED_FILE_ID).map(text) else {
            continue;
        };
        if id.is_empty() {
            continue;
        }
        let parts = id.split('\\').map(str::trim).collect::<Vec<_>>();
        if !parts.iter().copied().all(is_name) {
            return Err(outside(path));
        }
        // Media are often mounted with names in lower case.
        let written = parts.iter().collect::<PathBuf>();
        let small = parts.iter().map(|part| part.to_ascii_lowercase());
        let places = [written, small.collect()].map(|name| folder.join(name));
        match places.into_iter().find(|place| place.is_file()) {
            None => listed.missing += 1,
            Some(place) => {
                let found = place.canonicalize().map_err(|e| io(&place, e))?;
                if !found.starts_with(&real) {
                    return Err(outside(path));
                }
                listed.files.insert(place);
            }
        }
    }
    Ok(listed)
}

/// Whether a component of a file identifier is a plain file or folder name.
fn is_name(part: &str) -> bool {
    let path = Path::new(part);
    let mut parts = path.components();
    matches!(
        (parts.next(), parts.next()),
        (Some(Component::Normal(name)), None) if name == path.as_os_str()
    )
}

fn outside(path: &Path) -> ReadError {
    ReadError::BadTag {
        path: path.to_owned(),
        tag: "ReferencedFileID",
        found: "a path outside its folder".to_owned(),
        expected: "a file below it",
    }
}
