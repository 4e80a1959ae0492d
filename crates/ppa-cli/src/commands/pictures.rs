//! Pictures that commands write beside what they make.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use ppa_dataset::is_own_picture;

/// Where the picture beside a case goes, refused before any work if it would replace anything but such a picture.
pub fn picture_beside(case: &Path) -> anyhow::Result<PathBuf> {
    let path = case.with_extension("png");
    if !is_own_picture(&path) {
        require_new_picture(&path)?;
    }
    Ok(path)
}

/// Refuses, before any work, a picture that is not named as a PNG or that exists.
pub fn require_new_picture(path: &Path) -> anyhow::Result<()> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    ensure!(
        extension.eq_ignore_ascii_case("png"),
        "the picture {} would be a PNG: give a name that ends in .png",
        path.display()
    );
    let exists = path
        .try_exists()
        .with_context(|| format!("cannot look for {}", path.display()))?;
    ensure!(
        !exists,
        "{} exists: remove it, or give --picture another name",
        path.display()
    );
    Ok(())
}

/// The name of a file without its folders, which may say who the patient is.
pub fn shown_name(path: &Path) -> String {
    path.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}
