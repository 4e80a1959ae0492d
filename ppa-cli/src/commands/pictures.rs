//! Pictures written beside the results of commands.

use std::path::Path;

/// The name of a file without its folders, which may say who the patient is.
pub fn shown_name(path: &Path) -> String {
    path.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}
