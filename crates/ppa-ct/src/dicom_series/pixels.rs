//! Stored pixel values of one slice, unpacked.

use std::path::Path;

use super::file::damaged;
use super::header::Slice;
use super::{fragments, syntax};
use crate::error::ReadError;

/// Refuses a file that claims more pixels than its bytes can hold, before memory is reserved for them.
pub(super) fn check_size(slice: &Slice) -> Result<(), ReadError> {
    let (file, image) = (&slice.file, &slice.image);
    let expected = image.native_bytes() as u64 * image.frames as u64;
    let found = file.pixel_bytes()?;
    let fits = if file.is_native() {
        // An odd number of bytes is padded to an even one.
        found == expected || found == expected.next_multiple_of(2)
    } else {
        let most = syntax::codec(&file.path, &file.syntax)?.expands_at_most();
        expected <= found.saturating_mul(most)
    };
    if fits {
        return Ok(());
    }
    Err(ReadError::PixelCount {
        path: file.path.clone(),
        found,
        expected,
    })
}

/// Fills `containers` (rows x columns, columns fastest, little-endian) with the slice's pixels.
pub(super) fn read(slice: &Slice, containers: &mut Vec<u8>) -> Result<(), ReadError> {
    let file = &slice.file;
    if file.is_native() {
        let length = slice.image.native_bytes() as u64;
        file.native(slice.index as u64 * length, length, containers)?;
    } else {
        *containers = unpack(slice, &file.path)?;
    }
    Ok(())
}

fn unpack(slice: &Slice, path: &Path) -> Result<Vec<u8>, ReadError> {
    let uid = &slice.file.syntax;
    let codec = syntax::codec(path, uid)?;
    let bytes = slice.file.rest()?;
    let packed = fragments::of_frame(&bytes, slice.index, slice.image.frames)
        .map_err(|fault| damaged(path, fault))?
        .ok_or_else(|| syntax::unsupported(path, uid, "its fragments tell no frames apart"))?;
    codec
        .unpack(&packed, &slice.image)
        .map_err(|error| syntax::unsupported(path, uid, error))
}
