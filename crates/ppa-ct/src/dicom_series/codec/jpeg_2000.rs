//! JPEG 2000, reversible and irreversible (ISO/IEC 15444-1).

use hayro_jpeg2000::{DecodeSettings, DecoderContext, Image as Jp2};

use super::{CodecError, contain, expect_depth, expect_size};
use crate::dicom_series::header::Image;

pub(super) fn unpack(packed: &[u8], image: &Image) -> Result<Vec<u8>, CodecError> {
    let damaged = |error: &dyn std::fmt::Display| CodecError::Damaged(error.to_string());
    let settings = DecodeSettings {
        strict: true,
        ..DecodeSettings::default()
    };
    let stream = Jp2::new(packed, &settings).map_err(|e| damaged(&e))?;
    expect_size([stream.width() as usize, stream.height() as usize], image)?;
    let bits = u32::from(stream.original_bit_depth());
    expect_depth(bits, image)?;
    let mut context = DecoderContext::default();
    let decoded = stream.decode(&mut context).map_err(|e| damaged(&e))?;
    let [component] = decoded.components() else {
        return Err(CodecError::Unexpected {
            found: format!("{} components", decoded.components().len()),
            expected: "1 (grey)".to_owned(),
        });
    };
    // The decoder hands out samples above the lowest possible one; f32 holds up to 24 bits exactly.
    let (lowest, most) = (1_u32 << (bits - 1), (1_u64 << bits) as f32 - 1.0);
    let signed = is_signed(packed);
    let sample = |&v: &f32| {
        let above_lowest = v.round().clamp(0.0, most) as u32;
        if signed {
            above_lowest.wrapping_sub(lowest)
        } else {
            above_lowest
        }
    };
    contain(component.samples().iter().map(sample), image)
}

/// Whether the codestream itself says that its samples are signed; headers are known to disagree (section A.5.1).
fn is_signed(packed: &[u8]) -> bool {
    /// Start of codestream, and of the segment that holds sizes.
    const START: [u8; 4] = [0xff, 0x4f, 0xff, 0x51];
    /// Depth of the first component.
    const DEPTH_AT: usize = 42;
    let start = packed.windows(START.len()).position(|w| w == START);
    let depth = start.and_then(|start| packed.get(start + DEPTH_AT));
    depth.is_some_and(|depth| depth & 0x80 != 0)
}
