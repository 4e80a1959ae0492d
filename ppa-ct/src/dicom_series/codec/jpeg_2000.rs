//! JPEG 2000, reversible and irreversible (ISO/IEC 15444-1).

mod boxes;
mod cost;
mod segments;

use hayro_jpeg2000::{DecodeSettings, DecoderContext, Image as Jp2};

use super::{CodecError, contain, expect_frame, expect_grey, expect_memory};
use crate::dicom_series::header::Image;

/// Memory of the decoder per pixel: coefficients, their transform, samples, and bytes of its code-block.
const BYTES_PER_PIXEL: usize = 24;

pub(super) fn unpack(packed: &[u8], image: &Image) -> Result<Vec<u8>, CodecError> {
    let codestream = boxes::codestream(packed)?;
    cost::check(codestream)?;
    let damaged = |error: &dyn std::fmt::Display| CodecError::Damaged(error.to_string());
    let settings = DecodeSettings {
        strict: true,
        ..DecodeSettings::default()
    };
    // The boxes are ignored: their colour information does not matter for grey images.
    let stream = Jp2::new(codestream, &settings).map_err(|e| damaged(&e))?;
    let components = u32::from(stream.color_space().num_channels()) + u32::from(stream.has_alpha());
    let bits = u32::from(stream.original_bit_depth());
    let size = [stream.width() as usize, stream.height() as usize];
    expect_frame(size, components as usize, bits, image)?;
    expect_memory(image, BYTES_PER_PIXEL)?;
    let mut context = DecoderContext::default();
    let decoded = stream.decode(&mut context).map_err(|e| damaged(&e))?;
    let components = decoded.components();
    expect_grey(components.len())?;
    // The decoder returns samples relative to the lowest possible one; f32 holds up to 24 bits exactly.
    let (lowest, most) = (1_u32 << (bits - 1), (1_u64 << bits) as f32 - 1.0);
    let signed = is_signed(codestream);
    let sample = |&v: &f32| {
        let above_lowest = v.round().clamp(0.0, most) as u32;
        if signed {
            above_lowest.wrapping_sub(lowest)
        } else {
            above_lowest
        }
    };
    contain(components[0].samples().iter().map(sample), image)
}

/// Whether the codestream itself marks its samples as signed; headers are known to disagree (section A.5.1).
fn is_signed(codestream: &[u8]) -> bool {
    /// Offset of the depth of the first component.
    const DEPTH_AT: usize = 42;
    codestream.get(DEPTH_AT).is_some_and(|d| d & 0x80 != 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dicom_series::codec::FOUR_BY_FOUR;

    /// A codestream of 4 x 4 pixels with a single empty tile.
    fn stream(components: u8) -> Vec<u8> {
        let size = [[0, 0, 0, 4], [0; 4], [0, 0, 0, 4], [0; 4]].map(|v: [u8; 4]| [v, v].concat());
        let segment = |marker: u8, body: &[u8]| {
            let length = (body.len() as u16 + 2).to_be_bytes();
            [&[0xff, marker], &length[..], body].concat()
        };
        let depths = [7, 1, 1].repeat(components.into());
        [
            vec![0xff, 0x4f],
            segment(
                0x51,
                &[&[0; 2], &size.concat()[..], &[0, components], &depths].concat(),
            ),
            segment(0x52, &[0, 0, 0, 1, 0, 0, 4, 4, 0, 1]),
            segment(0x5c, &[0x40, 0x40]),
            segment(0x90, &[0, 0, 0, 0, 0, 0, 0, 1]),
            vec![0xff, 0x93, 0xff, 0xd9],
        ]
        .concat()
    }

    #[test]
    fn colour_is_refused_before_it_is_decoded() {
        let error = |components| {
            unpack(&stream(components), &FOUR_BY_FOUR)
                .unwrap_err()
                .to_string()
        };
        assert!(error(1).contains("damaged"), "{}", error(1));
        assert!(error(3).contains("3 components"), "{}", error(3));
        assert!(error(4).contains("4 components"), "{}", error(4));
    }
}
