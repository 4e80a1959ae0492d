//! The shard that a folder holds: `.ppa/part`, absent for a whole plan.

use std::io;
use std::path::Path;

use ppa_core::Part;
use ppa_dataset::files::FileError;
use serde::{Deserialize, Serialize};

use crate::seal::{Opened, opened, sealed};

/// Path from the dataset's root.
pub(crate) const PART_FILE: &str = ".ppa/part";

#[derive(Serialize, Deserialize)]
struct PartFile {
    part: String,
}

/// The text of the file; `None` for a whole plan.
pub(crate) fn part_text(part: Part) -> Option<String> {
    let file = PartFile {
        part: part.to_string(),
    };
    let text = || serde_json::to_string(&file).expect("a part is a JSON value");
    (part != Part::WHOLE).then(|| sealed(&text()))
}

/// Reads the part that the folder of a begun dataset should hold.
pub(crate) fn read_part(root: &Path) -> Result<Part, FileError> {
    let path = root.join(PART_FILE);
    let text = match ppa_core::regular_file::read_to_string(&path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Part::WHOLE),
        text => text.map_err(FileError::at("read", &path))?,
    };
    part_of_text(&text, &path)
}

/// Parses a part file that was read from `path`.
pub(crate) fn part_of_text(text: &str, path: &Path) -> Result<Part, FileError> {
    let part = match opened(text) {
        Opened::Sealed(text) => {
            let file: Result<PartFile, _> = serde_json::from_str(&text);
            file.ok().and_then(|file| file.part.parse().ok())
        }
        // As earlier versions wrote it.
        Opened::Unsealed => text.parse().ok(),
        Opened::Broken => None,
    };
    let damaged = || FileError::at("use", path)(io::Error::other("it is damaged"));
    part.ok_or_else(damaged)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::pose_id::FOLDER;

    #[test]
    fn no_flipped_bit_names_another_part() {
        let root = tempfile::tempdir().unwrap();
        fs::create_dir(root.path().join(FOLDER)).unwrap();
        let path = root.path().join(PART_FILE);
        assert_eq!(read_part(root.path()).unwrap(), Part::WHOLE);
        let text = part_text("2/7".parse().unwrap()).unwrap();
        fs::write(&path, &text).unwrap();
        assert_eq!(read_part(root.path()).unwrap().to_string(), "2/7");
        for bit in 0..8 * text.len() {
            let mut bytes = text.clone().into_bytes();
            bytes[bit / 8] ^= 1 << (bit % 8);
            fs::write(&path, bytes).unwrap();
            assert!(read_part(root.path()).is_err(), "bit {bit}");
        }
        fs::write(&path, "3/7").unwrap();
        assert_eq!(read_part(root.path()).unwrap().to_string(), "3/7");
    }
}
