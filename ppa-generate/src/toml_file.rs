//! Case, plan and room files as TOML, and the paths in them.

use std::io;
use std::path::{Component, Path, PathBuf};

use serde::Serialize;

use ppa_dataset::files::FileError;

/// Serialises the content of a file at `path` as TOML; refuses paths that are not UTF-8.
pub(crate) fn to_toml<T: Serialize>(value: &T, path: &Path) -> Result<String, FileError> {
    toml::to_string(value).map_err(|e| FileError::at("write", path)(io::Error::other(e)))
}

/// The format version of a TOML file, if it is not 1; its other keys are ignored.
pub(crate) fn other_version(text: &str) -> Option<u32> {
    #[derive(serde::Deserialize)]
    struct Versioned {
        version: u32,
    }
    let versioned: Versioned = toml::from_str(text).ok()?;
    (versioned.version != 1).then_some(versioned.version)
}

/// `path` relative to `folder`, with `..` where they diverge. Absolute paths stay absolute; paths become absolute if the way out of
/// `folder` is not known because it contains `..` itself or leads through links.
pub(crate) fn relative_to(path: &Path, folder: &Path) -> Result<PathBuf, FileError> {
    if path.is_absolute() {
        return Ok(path.to_owned());
    }
    let absolute = |p: &Path| std::path::absolute(p).map_err(FileError::at("resolve", p));
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let (path, folder) = (absolute(path)?, absolute(folder)?);
    let shared = path
        .components()
        .zip(folder.components())
        .take_while(|(a, b)| a == b)
        .count();
    let out_of = folder.components().skip(shared);
    let links = folder.ancestors().take(out_of.clone().count());
    if out_of.clone().any(|part| part == Component::ParentDir)
        || links.clone().any(Path::is_symlink)
    {
        return Ok(path);
    }
    let up = out_of.map(|_| Path::new(".."));
    let down = path.components().skip(shared);
    Ok(up
        .map(PathBuf::from)
        .chain(down.map(|c| PathBuf::from(&c)))
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scan_paths_are_written_as_seen_from_the_case() {
        let see =
            |path: &str, folder: &str| relative_to(Path::new(path), Path::new(folder)).unwrap();
        assert_eq!(see("scans/ct", "cases"), Path::new("../scans/ct"));
        assert_eq!(see("scans/ct", "scans"), Path::new("ct"));
        assert_eq!(see("p01.nii.gz", ""), Path::new("p01.nii.gz"));
        assert_eq!(see("../data/ct", "out"), Path::new("../../data/ct"));
        assert_eq!(see("../data/ct", "../cases"), Path::new("../data/ct"));
        let absolute = std::path::absolute("scan").unwrap();
        assert_eq!(see("scan", "../cases"), absolute);
        assert_eq!(see("scan", "a/../b"), absolute);
    }

    #[cfg(unix)]
    #[test]
    fn paths_in_a_linked_folder_are_absolute() {
        let base = tempfile::tempdir_in(".").unwrap();
        let base = Path::new(base.path().file_name().unwrap());
        std::fs::create_dir_all(base.join("disk/cases")).unwrap();
        std::os::unix::fs::symlink("disk/cases", base.join("cases")).unwrap();
        let scan = base.join("scan.nii");
        let absolute = std::path::absolute(&scan).unwrap();
        assert_eq!(relative_to(&scan, &base.join("cases")).unwrap(), absolute);
        let inside = relative_to(&scan, &base.join("disk/cases")).unwrap();
        assert_eq!(inside, Path::new("../../scan.nii"));
    }
}
