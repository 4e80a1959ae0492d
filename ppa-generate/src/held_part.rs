//! The part of its plan that a folder or archive holds.

use std::path::Path;

use ppa_core::Part;
use ppa_dataset::archive::is_archive;
use ppa_dataset::manifest::DESCRIPTION_FILE;

use crate::dataset_files::DatasetFiles;
use crate::dataset_lock::FolderError;
use crate::part_file::{PART_FILE, read_part};
use crate::pose_id::FOLDER;
use crate::record::record_names;

/// Returns the part of a plan that the folder or archive `root` holds, or will hold once its run is resumed; `None` if no run has begun.
///
/// # Errors
/// [`FolderError`] when its files cannot be read or are damaged.
pub fn held_part(root: &Path) -> Result<Option<Part>, FolderError> {
    if is_archive(root) {
        if !root.exists() {
            return Ok(None);
        }
        let files = DatasetFiles::open(root)?;
        return Ok(match files.is_empty_archive() {
            true => None,
            false => Some(files.part()?),
        });
    }
    let folder = root.join(FOLDER);
    if !folder.is_dir() {
        return Ok(None);
    }
    let begun = root.join(DESCRIPTION_FILE).exists() || !record_names(&folder)?.is_empty();
    Ok(if begun { Some(read_part(root)?) } else { None })
}

/// Refuses a run of another part than the folder holds.
pub(crate) fn require_part(root: &Path, asked: Part) -> Result<(), FolderError> {
    match held_part(root) {
        Ok(Some(held)) if held != asked => Err(FolderError::OtherPart {
            root: root.to_owned(),
            held,
            asked,
        }),
        // A damaged part file is not that of the whole plan, which has none. Shards may resume: records of other shards stop them.
        Err(FolderError::File(error))
            if error.path == root.join(PART_FILE) && asked != Part::WHOLE =>
        {
            Ok(())
        }
        held => held.map(|_| ()),
    }
}
