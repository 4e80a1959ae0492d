//! Files beside a plan that it may name: camera rigs and tables of materials.

use std::fs::DirEntry;
use std::path::{Path, PathBuf};

use ppa_dataset::files::FileError;
use ppa_depth::RigSpec;
use ppa_xray::HuCalibration;

use crate::error::StudioError;

/// Largest file that is read to see what it holds.
const MAX_BYTES: u64 = 1024 * 1024;

/// Names of files with what each of them holds, in the order of the names.
type Named = Vec<(String, String)>;

/// Files that the fields of a form offer.
#[derive(Debug, Default)]
pub(crate) struct FilesBeside {
    /// Camera rigs, with the sizes of their images.
    pub rigs: Named,
    /// Tables from HU to material and density, with their segments.
    pub tables: Named,
}

impl FilesBeside {
    /// Those in the folder of a plan that can be read as what they are offered for.
    pub fn of(folder: &Path) -> Result<Self, StudioError> {
        let entries = std::fs::read_dir(folder).map_err(FileError::at("read", folder))?;
        // Names that are not UTF-8 cannot stand in a plan; links may lead out of the folder.
        let plain = |entry: &DirEntry| {
            let about = entry.metadata();
            about.is_ok_and(|about| about.is_file() && about.len() <= MAX_BYTES)
        };
        let names = entries.filter_map(Result::ok).filter(plain);
        let mut names: Vec<String> = names
            .filter_map(|entry| entry.file_name().into_string().ok())
            .collect();
        names.sort();
        let named = |extension: &str, meaning: &dyn Fn(PathBuf) -> Option<String>| -> Named {
            let files = names.iter().filter(|name| name.ends_with(extension));
            files
                .filter_map(|name| Some((name.clone(), meaning(folder.join(name))?)))
                .collect()
        };
        Ok(Self {
            rigs: named(".json", &|file| Some(sizes(&RigSpec::read(&file).ok()?))),
            tables: named(".toml", &|file| {
                Some(segments(&HuCalibration::read(&file).ok()?))
            }),
        })
    }
}

/// Images of a rig's cameras.
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
