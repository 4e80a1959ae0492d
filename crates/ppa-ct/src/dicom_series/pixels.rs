//! Stored pixel values of one slice become Hounsfield units.

use std::panic::{AssertUnwindSafe, catch_unwind};

use dicom_core::{DicomValue, PrimitiveValue};
use dicom_dictionary_std::{tags, uids};
use dicom_object::DefaultDicomObject;
use dicom_pixeldata::PixelDecoder;

use super::header::{PixelFormat, Slice};
use super::open::{Extent, open};
use super::{rle, syntax};
use crate::error::ReadError;

/// Fills `hu` (rows x columns, columns fastest) with the slice's pixels.
pub(super) fn decode(slice: &Slice, hu: &mut [f32]) -> Result<(), ReadError> {
    let object = open(&slice.path, Extent::Pixels)?;
    let Some(element) = object.get(tags::PIXEL_DATA) else {
        return Err(ReadError::MissingTag {
            path: slice.path.clone(),
            tag: "PixelData",
        });
    };
    let [slope, intercept] = slice.rescale.unwrap_or([1.0, 0.0]);
    let to_hu = |raw| (slope * slice.pixel.value(raw) + intercept) as f32;
    match element.value() {
        DicomValue::Primitive(PrimitiveValue::U16(words)) if slice.pixel.bits_allocated == 16 => {
            expect_bytes(slice, 2 * words.len(), hu.len())?;
            for (hu, &word) in hu.iter_mut().zip(words) {
                *hu = to_hu(u32::from(word));
            }
            Ok(())
        }
        DicomValue::Primitive(PrimitiveValue::U16(words)) if slice.pixel.bits_allocated == 8 => {
            // Two pixels share a word, the first in the low byte (PS3.5, section 8.1.1).
            let bytes = words
                .iter()
                .flat_map(|w| w.to_le_bytes())
                .collect::<Vec<_>>();
            from_bytes(slice, &bytes, hu, to_hu)
        }
        DicomValue::Primitive(native) => from_bytes(slice, &native.to_bytes(), hu, to_hu),
        DicomValue::PixelSequence(_) => from_bytes(slice, &unpack(slice, &object)?, hu, to_hu),
        DicomValue::Sequence(_) => Err(ReadError::BadTag {
            path: slice.path.clone(),
            tag: "PixelData",
            found: "a sequence of items".to_owned(),
            expected: "pixel values",
        }),
    }
}

/// Decompresses encapsulated pixels.
fn unpack(slice: &Slice, object: &DefaultDicomObject) -> Result<Vec<u8>, ReadError> {
    let uid = object
        .meta()
        .transfer_syntax()
        .trim_end_matches(['\0', ' ']);
    let damaged = || syntax::unsupported(&slice.path, uid, "the compressed stream is damaged");
    if uid == uids::RLE_LOSSLESS {
        let element = object.get(tags::PIXEL_DATA);
        let fragments = element.and_then(|e| e.fragments()).unwrap_or_default();
        let width = slice.pixel.bits_allocated as usize / 8;
        return rle::unpack(&fragments.concat(), slice.rows * slice.columns, width)
            .ok_or_else(damaged);
    }
    // The JPEG adapter slices out of bounds when a frame is larger than its header says.
    match catch_unwind(AssertUnwindSafe(|| object.decode_pixel_data())) {
        Ok(Ok(pixels)) => Ok(pixels.into_data()),
        Ok(Err(error)) => Err(syntax::unsupported(&slice.path, uid, error)),
        Err(_) => Err(damaged()),
    }
}

/// Values from little-endian containers.
fn from_bytes(
    slice: &Slice,
    bytes: &[u8],
    hu: &mut [f32],
    to_hu: impl Fn(u32) -> f32,
) -> Result<(), ReadError> {
    expect_bytes(slice, bytes.len(), hu.len())?;
    let width = slice.pixel.bits_allocated as usize / 8;
    for (hu, container) in hu.iter_mut().zip(bytes.chunks_exact(width)) {
        let mut word = [0; 4];
        word[..width].copy_from_slice(container);
        *hu = to_hu(u32::from_le_bytes(word));
    }
    Ok(())
}

fn expect_bytes(slice: &Slice, found: usize, pixels: usize) -> Result<(), ReadError> {
    let expected = pixels * slice.pixel.bits_allocated as usize / 8;
    // An odd number of bytes is padded to an even one.
    if found == expected || found == expected.next_multiple_of(2) {
        return Ok(());
    }
    Err(ReadError::PixelCount {
        path: slice.path.clone(),
        found: found as u64,
        expected: expected as u64,
    })
}

impl PixelFormat {
    /// The number in a container: bits outside the stored ones are dropped, the sign extended.
    fn value(&self, container: u32) -> f64 {
        let dropped_above = 31 - self.high_bit;
        let unused = 32 - self.bits_stored;
        if self.signed {
            f64::from((container << dropped_above).cast_signed() >> unused)
        } else {
            f64::from((container << dropped_above) >> unused)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Whatever sits in the unused bits, the value that was put in comes out.
        #[test]
        fn stored_value_survives_its_container(
            (allocated, stored, high) in prop::sample::select(vec![8_u32, 16, 32])
                .prop_flat_map(|a| (Just(a), 2..=a))
                .prop_flat_map(|(a, s)| (Just(a), Just(s), s - 1..a)),
            bits in any::<u32>(),
            noise in any::<u32>(),
            signed in any::<bool>(),
        ) {
            let mask = u32::MAX >> (32 - stored);
            let low = high + 1 - stored;
            let container = ((bits & mask) << low) | (noise & !(mask << low));
            let value = i64::from(bits & mask);
            let negative = signed && value >= 1 << (stored - 1);
            let expected = if negative { value - (1 << stored) } else { value };
            let format = PixelFormat { bits_allocated: allocated, bits_stored: stored, high_bit: high, signed };
            prop_assert_eq!(format.value(container), expected as f64);
        }
    }
}
