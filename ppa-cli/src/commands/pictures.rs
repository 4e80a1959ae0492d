//! Pictures written next to the results of commands.

use std::path::Path;

/// Name of a file without its folders, which may identify the patient.
pub fn shown_name(path: &Path) -> String {
    path.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}
