//! Which part of a plan a folder is to hold: `.ppa/part`, absent where it is the whole.

use std::io;
use std::path::{Path, PathBuf};

use ppa_xray::Part;

use crate::files::{FileError, remove_if_there, write_whole};
use crate::record::FOLDER;

fn path(root: &Path) -> PathBuf {
    root.join(FOLDER).join("part")
}

pub(crate) fn write_part(root: &Path, part: Part) -> Result<(), FileError> {
    let path = path(root);
    if part != Part::WHOLE {
        return write_whole(&path, part.to_string().as_bytes());
    }
    remove_if_there(&path)
}

pub(crate) fn read_part(root: &Path) -> Result<Part, FileError> {
    let path = path(root);
    match ppa_files::read_to_string(&path) {
        Ok(text) => text
            .parse()
            .map_err(|e| FileError::at("parse", &path)(io::Error::other(e))),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Part::WHOLE),
        Err(error) => Err(FileError::at("read", &path)(error)),
    }
}
