//! Stored pixel values of one slice, unpacked.

use std::path::Path;

use super::file::damaged;
use super::header::Slice;
use super::{fragments, syntax};
use crate::error::ReadError;

/// Largest average expansion of a byte over a series of JPEG-LS or JPEG 2000.
const EXPANDS_AT_MOST: u64 = 1 << 14;
/// Decoded size that any such series may have, however well it compresses: a blank slice of 4096 x 4096 pixels of 32
/// bits, or eight of 2048 x 2048 of 16.
const ALWAYS_BYTES: u64 = 1 << 26;

/// Refuses files that claim more pixels than their bytes can hold, before memory is reserved for them.
pub(super) fn check_sizes(slices: &[Slice]) -> Result<(), ReadError> {
    let wrong = |slice: &Slice, found, expected| ReadError::PixelCount {
        path: slice.file.path.clone(),
        found,
        expected,
    };
    let (mut packed, mut unpacked) = (0_u64, 0_u64);
    for slice in slices.iter().filter(|slice| slice.index == 0) {
        let (file, image) = (&slice.file, &slice.image);
        let expected = (image.native_bytes() as u64).saturating_mul(image.frames as u64);
        let found = file.pixel_bytes()?;
        let fits = if file.is_native() {
            // An odd number of bytes is padded to an even one.
            found == expected || found == expected.next_multiple_of(2)
        } else if let Some(most) = syntax::codec(&file.path, &file.syntax)?.expands_at_most() {
            expected <= found.saturating_mul(most)
        } else {
            packed = packed.saturating_add(found);
            unpacked = unpacked.saturating_add(expected);
            unpacked <= packed.saturating_mul(EXPANDS_AT_MOST).max(ALWAYS_BYTES)
        };
        if !fits {
            return Err(wrong(slice, found, expected));
        }
    }
    Ok(())
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
    let bytes = slice.file.fragments()?;
    let packed = fragments::of_frame(&bytes, slice.index, slice.image.frames)
        .map_err(|fault| damaged(path, fault))?
        .ok_or_else(|| {
            syntax::unsupported(path, uid, "its fragments cannot be assigned to frames")
        })?;
    codec
        .unpack(&packed, &slice.image)
        .map_err(|error| syntax::unsupported(path, uid, error))
}
