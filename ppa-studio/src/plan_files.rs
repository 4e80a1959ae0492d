//! Files next to a plan that it may name: camera rigs and tables of materials.

use std::collections::HashMap;
use std::fs::{DirEntry, Metadata};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::SystemTime;

use ppa_core::text::error_chain;
use ppa_dataset::files::FileError;
use ppa_depth::RigSpec;
use ppa_xray::HuCalibration;

use crate::error::StudioError;

/// Maximum size of a file that is read to determine its kind.
const MAX_BYTES: u64 = 1024 * 1024;

/// File names with a summary of the contents or the reason for an error, sorted by name.
type Named = Vec<(String, String)>;

/// Files offered by a field of the form.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Offered {
    /// Readable files with a summary of their contents.
    pub readable: Named,
    /// Files of this kind that cannot be read, with the reason.
    pub unreadable: Named,
}

/// Files offered by the fields of the form.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct FilesBeside {
    /// Camera rigs with their image sizes.
    pub rigs: Offered,
    /// Tables from HU to material and density, with the names of their segments.
    pub tables: Offered,
}

/// Kind of a file that a plan may name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Rig,
    Table,
}

/// Kind of a file with a summary of its contents, or why it cannot be read; `None` for a file of another kind.
type Meaning = Option<(Kind, Result<String, String>)>;

/// Cache of files, which are read again only if they have changed.
#[derive(Default)]
pub(crate) struct PlanFiles(Mutex<HashMap<PathBuf, Known>>);

struct Known {
    written: Option<SystemTime>,
    bytes: u64,
    meaning: Meaning,
}

impl PlanFiles {
    /// Returns the files in the folder of a plan.
    pub fn beside(&self, folder: &Path) -> Result<FilesBeside, StudioError> {
        let entries = std::fs::read_dir(folder).map_err(FileError::at("read", folder))?;
        // A plan cannot contain names that are not UTF-8; links may lead out of the folder.
        let plain = |entry: DirEntry| {
            let about = entry.metadata().ok()?;
            let is_plain = about.is_file() && about.len() <= MAX_BYTES;
            Some((entry.file_name().into_string().ok()?, about)).filter(|_| is_plain)
        };
        let entries = entries.filter_map(Result::ok).filter_map(plain);
        let mut files: Vec<(String, Metadata)> = entries.collect();
        files.sort_by(|(a, _), (b, _)| a.cmp(b));
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut before = std::mem::take(&mut *known);
        let mut found = FilesBeside::default();
        for (name, about) in files {
            let path = folder.join(&name);
            let (written, bytes) = (about.modified().ok(), about.len());
            let same =
                |file: &Known| written.is_some() && (file.written, file.bytes) == (written, bytes);
            let file = before.remove(&path).filter(same);
            let file = file.unwrap_or_else(|| Known {
                written,
                bytes,
                meaning: meaning(&path),
            });
            if let Some((kind, contents)) = file.meaning.clone() {
                let offered = match kind {
                    Kind::Rig => &mut found.rigs,
                    Kind::Table => &mut found.tables,
                };
                match contents {
                    Ok(contents) => offered.readable.push((name, contents)),
                    Err(reason) => offered.unreadable.push((name, reason)),
                }
            }
            known.insert(path, file);
        }
        Ok(found)
    }
}

/// Reads a file and summarises its contents; `None` if it is not of a kind that a plan can name.
fn meaning(path: &Path) -> Meaning {
    let is = |extension: &str| path.extension().is_some_and(|found| found == extension);
    let kind = match (is("json"), is("toml")) {
        (true, _) => Kind::Rig,
        (_, true) => Kind::Table,
        _ => return None,
    };
    let read = match kind {
        Kind::Rig => RigSpec::read(path)
            .map(|rig| sizes(&rig))
            .map_err(|error| error_chain(&error)),
        Kind::Table => HuCalibration::read(path)
            .map(|table| segments(&table))
            .map_err(|error| error_chain(&error)),
    };
    if read.is_err() && !looks_like(kind, path) {
        return None;
    }
    // The page shows the file name next to the reason.
    let folder = path.parent().unwrap_or(Path::new("")).display().to_string();
    let reason = |error: String| error.replace(&format!("{folder}/"), "");
    Some((kind, read.map_err(reason)))
}

/// Whether an unreadable file was meant to be of a kind: a rig has `left` or `right`, a table `segment`. Invalid JSON may be
/// a damaged rig.
fn looks_like(kind: Kind, path: &Path) -> bool {
    let Ok(text) = std::fs::read_to_string(path) else {
        return true;
    };
    match kind {
        Kind::Rig => match serde_json::from_str::<serde_json::Value>(&text) {
            Ok(value) => ["left", "right"]
                .iter()
                .any(|side| value.get(side).is_some()),
            Err(_) => true,
        },
        Kind::Table => match text.parse::<toml::Table>() {
            Ok(table) => table.contains_key("segment"),
            Err(_) => text
                .lines()
                .any(|line| line.trim_start().starts_with("[[segment")),
        },
    }
}

/// Describes the image sizes of a rig's cameras.
fn sizes(rig: &RigSpec) -> String {
    let [left, right] = [&rig.left, &rig.right]
        .map(|mounted| format!("{} x {}", mounted.camera.width, mounted.camera.height));
    if left == right {
        return format!("both {left} pixels");
    }
    format!("{left} and {right} pixels")
}

fn segments(table: &HuCalibration) -> String {
    let names: Vec<&str> = table.segments.iter().map(|s| s.name.as_str()).collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str =
        "[[segment]]\nname = \"water\"\nmaterial = \"water\"\ndensity = [[0, 1.0]]\n";

    fn names(files: &Named) -> Vec<&str> {
        files.iter().map(|(name, _)| name.as_str()).collect()
    }

    #[test]
    fn unreadable_rigs_and_tables_are_named_with_the_reason() {
        let folder = tempfile::tempdir().unwrap();
        let rig = serde_json::to_string(&RigSpec::default()).unwrap();
        let write = |name: &str, text: &str| {
            std::fs::write(folder.path().join(name), text).unwrap();
        };
        write("good.json", &rig);
        write("cut.json", &rig[..rig.len() / 2]);
        write("one.json", "{\"left\": {}}");
        write("splits.json", "{\"version\": 1}");
        write("water.toml", TABLE);
        write("typo.toml", &TABLE.replace("density", "densty"));
        write("broken.toml", "[[segment]]\nname = \"water\n");
        write("train.toml", "preset = \"quick\"\n");
        write("notes.toml", "what = ever = this\n");
        let found = PlanFiles::default().beside(folder.path()).unwrap();
        assert_eq!(names(&found.rigs.readable), ["good.json"]);
        assert_eq!(names(&found.rigs.unreadable), ["cut.json", "one.json"]);
        assert_eq!(names(&found.tables.readable), ["water.toml"]);
        let unreadable = &found.tables.unreadable;
        assert_eq!(names(unreadable), ["broken.toml", "typo.toml"]);
        assert!(unreadable[1].1.contains("densty"), "{unreadable:?}");
        let folder = folder.path().to_string_lossy().into_owned();
        let reasons = found.rigs.unreadable.iter().chain(unreadable);
        for (_, reason) in reasons {
            assert!(!reason.contains(&folder), "{reason}");
        }
    }

    /// A file with unchanged time and length is not read again.
    #[test]
    fn files_are_read_again_only_when_they_change() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("water.toml");
        let write = |text: &str, time: SystemTime| {
            std::fs::write(&file, text).unwrap();
            let file = std::fs::File::options().write(true).open(&file).unwrap();
            file.set_modified(time).unwrap();
        };
        let time = SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(1_000_000);
        let files = PlanFiles::default();
        let contents = || {
            let found = files.beside(folder.path()).unwrap();
            found.tables.readable[0].1.clone()
        };
        write(TABLE, time);
        assert_eq!(contents(), "water");
        let other = TABLE.replace("name = \"water\"", "name = \"blood\"");
        write(&other, time);
        assert_eq!(contents(), "water");
        write(&other, time + std::time::Duration::from_secs(1));
        assert_eq!(contents(), "blood");
        std::fs::remove_file(&file).unwrap();
        let found = files.beside(folder.path()).unwrap();
        assert_eq!(found, FilesBeside::default());
    }
}
