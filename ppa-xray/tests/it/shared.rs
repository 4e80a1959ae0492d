//! Location of the reference data.

use std::path::PathBuf;

/// Path of a file of the shared data: next to the repository, or under `PPA_SHARED`.
pub fn path(relative: &str) -> PathBuf {
    std::env::var_os("PPA_SHARED")
        .map_or_else(
            || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared")),
            PathBuf::from,
        )
        .join(relative)
}
