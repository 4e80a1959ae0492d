//! Datasets in a folder and datasets in an archive, told apart by their path.

use std::path::Path;

/// Whether a dataset of this path is an archive: its name ends in `.tar`, and it is no folder.
pub(crate) fn is_archive(root: &Path) -> bool {
    root.extension().is_some_and(|extension| extension == "tar") && !root.is_dir()
}
