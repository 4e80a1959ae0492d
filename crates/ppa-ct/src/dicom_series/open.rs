//! Opening DICOM files, also those with mistakes in the optional part of their file meta group.

use std::io::Cursor;
use std::path::Path;

use dicom_dictionary_std::tags;
use dicom_object::{DefaultDicomObject, OpenFileOptions, ReadError as Cause};

use super::syntax;
use crate::error::ReadError;

/// How much of a file to read.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Extent {
    /// Everything before the pixels.
    Header,
    /// The pixels too.
    Pixels,
}

/// Opens a file; where the parser refuses its meta group, the needed part of that is tried alone.
pub(super) fn open(path: &Path, extent: Extent) -> Result<DefaultDicomObject, ReadError> {
    let options = || match extent {
        Extent::Header => OpenFileOptions::new().read_until(tags::PIXEL_DATA),
        Extent::Pixels => OpenFileOptions::new().read_to(tags::PIXEL_DATA),
    };
    let error = match options().open_file(path) {
        Ok(object) => return Ok(object),
        Err(error) => error,
    };
    if matches!(error, Cause::ParseMetaDataSet { .. })
        && let Some(repaired) = std::fs::read(path).ok().and_then(with_bare_meta_group)
    {
        return options()
            .from_reader(Cursor::new(repaired))
            .map_err(|e| explain(path, e));
    }
    Err(explain(path, error))
}

/// The same file with only the needed elements of its meta group, their length counted anew.
///
/// Some writers leave a wrong group length, or application titles longer than allowed. The group
/// holds explicit little-endian elements, whatever follows (PS3.10, section 7.1). `None` when it
/// does not even do that.
fn with_bare_meta_group(file: Vec<u8>) -> Option<Vec<u8>> {
    /// Preamble and `DICM`.
    const START: usize = 132;
    /// Element (0002,0000) of VR UL and length 4; its value follows.
    const GROUP_LENGTH: [u8; 8] = [2, 0, 0, 0, b'U', b'L', 4, 0];
    /// Version, class, instance and transfer syntax.
    const NEEDED: [[u8; 2]; 4] = [[1, 0], [2, 0], [3, 0], [0x10, 0]];
    let mut group = Vec::new();
    let mut at = START;
    while file.get(at..at + 2)? == [2, 0] {
        let long_form = matches!(
            file.get(at + 4..at + 6)?,
            b"OB" | b"OW" | b"SQ" | b"UN" | b"UT" | b"UC" | b"UR"
        );
        let next = at
            + if long_form {
                12 + u32::from_le_bytes(file.get(at + 8..at + 12)?.try_into().ok()?) as usize
            } else {
                8 + usize::from(u16::from_le_bytes(
                    file.get(at + 6..at + 8)?.try_into().ok()?,
                ))
            };
        let element = file.get(at..next)?;
        if NEEDED.iter().any(|number| element[2..4] == *number) {
            group.extend_from_slice(element);
        }
        at = next;
    }
    let length = u32::try_from(group.len()).ok()?.to_le_bytes();
    Some([&file[..START], &GROUP_LENGTH, &length, &group, &file[at..]].concat())
}

/// Our error for one of the parser's.
fn explain(path: &Path, error: Cause) -> ReadError {
    let uid = match &error {
        Cause::OpenFile { .. } => {
            return ReadError::Io {
                path: path.to_owned(),
                source: std::io::Error::other(error),
            };
        }
        Cause::ReadUnrecognizedTransferSyntax { uid, .. } => uid.clone(),
        Cause::ReadUnsupportedTransferSyntax { uid, .. }
        | Cause::ReadUnsupportedTransferSyntaxWithSuggestion { uid, .. } => (*uid).to_owned(),
        _ => {
            return ReadError::Dicom {
                path: path.to_owned(),
                source: Box::new(error),
            };
        }
    };
    syntax::unsupported(path, &uid, error)
}
