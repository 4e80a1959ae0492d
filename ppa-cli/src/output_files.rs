//! Files and folders that a command writes: declared and tried before any work is done.

use std::collections::HashMap;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use clap::Args;
use ppa_ct::Format;
use ppa_generate::free_bytes;

use crate::output::bytes as in_words;

/// File extensions of meshes, point clouds, pictures, and volumes without Hounsfield units.
pub const MESH: &[&str] = &[".ply", ".obj", ".stl"];
pub const CLOUD: &[&str] = &[".ply", ".obj"];
pub const PICTURE: &[&str] = &[".png"];
pub const NUMBERS: &[&str] = &[".nii", ".nii.gz", ".nrrd", ".mha", ".mhd"];

/// Bytes written to each folder to test whether the disk accepts them.
const PROBE: usize = 4096;

#[derive(Debug, Clone, Copy, Default, Args)]
pub struct ReplaceArgs {
    /// Replace existing output files; each old file is kept until the new one is complete
    #[arg(long)]
    replace: bool,
}

impl ReplaceArgs {
    /// Makes an empty list of outputs to declare.
    pub fn outputs(self) -> OutputFiles {
        OutputFiles {
            replace: self.replace,
            declared: HashMap::new(),
            tried: Vec::new(),
        }
    }

    /// The same, but files are also replaced if `also` is true.
    pub fn or(self, also: bool) -> Self {
        Self {
            replace: self.replace || also,
        }
    }

    /// Whether `--replace` was given.
    pub fn is_given(self) -> bool {
        self.replace
    }
}

/// The outputs of a command. A declaration is refused for an existing file without `--replace`, a name with the wrong
/// extension, a folder that is missing or not writable, and one file for two outputs.
#[derive(Debug)]
pub struct OutputFiles {
    replace: bool,
    /// The option that declared each resolved path.
    declared: HashMap<PathBuf, String>,
    /// Folders known to be writable.
    tried: Vec<PathBuf>,
}

impl OutputFiles {
    /// Outputs of a command that never replaces files.
    pub fn new() -> Self {
        ReplaceArgs::default().outputs()
    }

    /// Declares a file in an existing folder; `endings` are the allowed extensions, or empty if any will do.
    pub fn file(&mut self, option: &str, path: &Path, endings: &[&str]) -> anyhow::Result<()> {
        require_folder_of(option, path)?;
        self.file_in_new_folder(option, path, endings)
    }

    /// The same as [`Self::file`], for writers that create missing folders.
    pub fn file_in_new_folder(
        &mut self,
        option: &str,
        path: &Path,
        endings: &[&str],
    ) -> anyhow::Result<()> {
        let named = format!("{option} {}", path.display());
        ensure!(
            has_ending(path, endings),
            "{named}: expected a name that ends in {}",
            listed(endings)
        );
        ensure!(
            path.file_name().is_some() && !path.is_dir(),
            "{named} is a folder, expected a file"
        );
        if let Ok(found) = path.symlink_metadata() {
            ensure!(
                self.replace,
                "{named} exists: give --replace to replace it, or choose another name"
            );
            let target = path.metadata().unwrap_or(found);
            ensure!(target.is_file(), "{named} is not a regular file");
        }
        self.declare(option, path)
    }

    /// Declares a file if one was asked for.
    pub fn optional(
        &mut self,
        option: &str,
        path: Option<&PathBuf>,
        endings: &[&str],
    ) -> anyhow::Result<()> {
        match path {
            Some(path) => self.file(option, path, endings),
            None => Ok(()),
        }
    }

    /// Declares a volume: a file, or a new folder of DICOM slices.
    pub fn volume(&mut self, option: &str, path: &Path) -> anyhow::Result<()> {
        if Format::of_name(path)? == Format::Dicom {
            require_folder_of(option, path)?;
            return self.folder(option, path);
        }
        self.file(option, path, NUMBERS)
    }

    /// Declares a folder to fill, which must be new or empty: `--replace` replaces files, never a folder with its contents.
    pub fn folder(&mut self, option: &str, path: &Path) -> anyhow::Result<()> {
        let named = format!("{option} {}", path.display());
        if path.is_dir() {
            let entries = fs::read_dir(path).with_context(|| format!("cannot read {named}"))?;
            ensure!(
                entries.count() == 0,
                "{named} is not an empty folder: empty it, or choose another one"
            );
        } else {
            ensure!(
                path.symlink_metadata().is_err(),
                "{named} exists and is not a folder: choose another name"
            );
        }
        // `out/` and `out` are the same folder.
        let path: PathBuf = path.components().collect();
        self.declare(option, &path)
    }

    fn declare(&mut self, option: &str, path: &Path) -> anyhow::Result<()> {
        let folder = folder_of(path);
        if !self.tried.contains(&folder) {
            try_folder(&folder)
                .with_context(|| format!("cannot write {option} {}", path.display()))?;
            self.tried.push(folder);
        }
        let path = resolved(path)?;
        match self.declared.insert(path, option.to_owned()) {
            Some(other) => {
                bail!("{other} and {option} name the same file: expected two different files")
            }
            None => Ok(()),
        }
    }
}

/// Refuses a folder that is not writable; a missing one must be possible to create.
pub fn require_writable(option: &str, folder: &Path) -> anyhow::Result<()> {
    try_folder(folder).with_context(|| format!("cannot write {option} {}", folder.display()))
}

/// Refuses to overwrite a file with other contents without `--replace`.
pub fn require_same(path: &Path, bytes: &[u8], replace: ReplaceArgs) -> anyhow::Result<()> {
    let same = replace.is_given() || path.symlink_metadata().is_err() || holds(path, bytes);
    ensure!(
        same,
        "{} exists and differs from what would be written: give --replace to replace it",
        path.display()
    );
    Ok(())
}

/// Refuses a folder whose disk has no room for `needed` bytes.
pub fn require_room(folder: &Path, needed: u64) -> anyhow::Result<()> {
    match free_bytes(folder) {
        Some(free) if free < needed => bail!(
            "{} would take up {}, but only {} are free",
            folder.display(),
            in_words(needed),
            in_words(free)
        ),
        _ => Ok(()),
    }
}

/// Total size of all files below a folder in bytes, except hidden ones and any that cannot be read.
pub fn bytes_below(folder: &Path) -> u64 {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let seen = entries.filter(|entry| !entry.file_name().as_encoded_bytes().starts_with(b"."));
    let size = |entry: fs::DirEntry| match entry.metadata() {
        Ok(found) if found.is_dir() => bytes_below(&entry.path()),
        Ok(found) if found.is_file() => found.len(),
        _ => 0,
    };
    seen.map(size).sum()
}

/// Whether a file has these contents, so that writing it again replaces nothing.
fn holds(path: &Path, bytes: &[u8]) -> bool {
    let size = path.metadata().map(|found| found.len());
    size.is_ok_and(|size| size == bytes.len() as u64)
        && fs::read(path).is_ok_and(|found| found == bytes)
}

fn require_folder_of(option: &str, path: &Path) -> anyhow::Result<()> {
    let folder = folder_of(path);
    ensure!(
        folder.exists(),
        "{option} {}: the folder {} does not exist",
        path.display(),
        folder.display()
    );
    Ok(())
}

fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// Writes an unnamed file to a folder, or to its nearest existing parent.
fn try_folder(folder: &Path) -> io::Result<()> {
    let whole = std::path::absolute(folder)?;
    let nearest = whole.ancestors().find(|path| path.exists());
    let nearest = nearest.unwrap_or(&whole);
    if !nearest.is_dir() {
        let text = format!("{} is not a folder", nearest.display());
        return Err(io::Error::new(io::ErrorKind::NotADirectory, text));
    }
    let mut probe = tempfile::tempfile_in(nearest)?;
    probe.write_all(&[0; PROBE])?;
    probe.sync_data()
}

fn resolved(path: &Path) -> io::Result<PathBuf> {
    let folder = folder_of(path);
    let folder = folder
        .canonicalize()
        .or_else(|_| std::path::absolute(&folder))?;
    Ok(folder.join(path.file_name().unwrap_or_default()))
}

fn has_ending(path: &Path, endings: &[&str]) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let name = name.to_ascii_lowercase();
    let ends = |ending: &&str| name.len() > ending.len() && name.ends_with(*ending);
    endings.is_empty() || endings.iter().any(ends)
}

/// Joins extensions as `.ply, .obj or .stl`.
fn listed(endings: &[&str]) -> String {
    match endings {
        [others @ .., last] if !others.is_empty() => format!("{} or {last}", others.join(", ")),
        _ => endings.concat(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outputs(replace: bool) -> OutputFiles {
        ReplaceArgs { replace }.outputs()
    }

    fn said(result: anyhow::Result<()>) -> String {
        format!("{:#}", result.unwrap_err())
    }

    #[test]
    fn an_existing_file_needs_replace() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.png");
        outputs(false).file("--out", &path, &[".png"]).unwrap();
        assert!(!path.exists(), "trying an output leaves nothing");
        fs::write(&path, "kept").unwrap();
        let refused = said(outputs(false).file("--out", &path, &[".png"]));
        assert!(
            refused.contains("x.png exists: give --replace"),
            "{refused}"
        );
        outputs(true).file("--out", &path, &[".png"]).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"kept");
    }

    #[test]
    fn endings_are_those_of_the_format() {
        let folder = tempfile::tempdir().unwrap();
        let name = |name: &str| folder.path().join(name);
        for good in ["x.ply", "x.STL", "a.b.obj"] {
            outputs(false).file("--out", &name(good), MESH).unwrap();
        }
        for bad in ["x.jpg", "x", ".ply", "xply"] {
            let refused = said(outputs(false).file("--out", &name(bad), MESH));
            assert!(
                refused.contains("expected a name that ends in .ply, .obj or .stl"),
                "{refused}"
            );
        }
        outputs(false).file("--tally", &name("any"), &[]).unwrap();
    }

    #[test]
    fn a_missing_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("nowhere/x.png");
        let refused = said(outputs(false).file("--out", &path, &[]));
        assert!(refused.contains("nowhere does not exist"), "{refused}");
        let created = outputs(false).file_in_new_folder("--out", &path, &[]);
        created.unwrap();
        assert!(!folder.path().join("nowhere").exists());
        fs::write(folder.path().join("nowhere"), "a file").unwrap();
        let refused = said(outputs(false).file("--out", &path, &[]));
        assert!(refused.contains("nowhere is not a folder"), "{refused}");
    }

    #[test]
    fn two_outputs_are_two_files() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("sub")).unwrap();
        let mut declared = outputs(false);
        let path = folder.path().join("x.png");
        declared.file("--out", &path, &[]).unwrap();
        let again = folder.path().join("sub/../x.png");
        let refused = said(declared.file("--preview", &again, &[]));
        assert!(
            refused.contains("--out and --preview name the same file"),
            "{refused}"
        );
    }

    #[test]
    fn a_folder_with_files_is_never_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bag");
        outputs(true).folder("--out", &path).unwrap();
        fs::create_dir(&path).unwrap();
        outputs(true).folder("--out", &path).unwrap();
        fs::write(path.join("notes.txt"), "kept").unwrap();
        let refused = said(outputs(true).folder("--out", &path));
        assert!(refused.contains("not an empty folder"), "{refused}");
        let refused = said(outputs(true).file("--out", &path, &[]));
        assert!(
            refused.contains("is a folder, expected a file"),
            "{refused}"
        );
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn an_unwritable_folder_is_refused() {
        let refused = said(outputs(false).file("--out", Path::new("/proc/x.png"), &[]));
        assert!(
            refused.contains("cannot write --out /proc/x.png"),
            "{refused}"
        );
        let refused = said(outputs(true).file("--out", Path::new("/dev/null"), &[]));
        assert!(refused.contains("not a regular file"), "{refused}");
    }

    #[test]
    fn more_than_the_disk_holds_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        require_room(folder.path(), 1).unwrap();
        if free_bytes(folder.path()).is_some() {
            let refused = said(require_room(folder.path(), u64::MAX));
            assert!(refused.contains("are free"), "{refused}");
        }
        fs::write(folder.path().join("a"), [0; 300]).unwrap();
        fs::create_dir(folder.path().join("b")).unwrap();
        fs::write(folder.path().join("b/c"), [0; 30]).unwrap();
        fs::write(folder.path().join(".hidden"), [0; 3]).unwrap();
        assert_eq!(bytes_below(folder.path()), 330);
        assert!(holds(&folder.path().join("b/c"), &[0; 30]));
        assert!(!holds(&folder.path().join("b/c"), &[0; 29]));
    }
}
