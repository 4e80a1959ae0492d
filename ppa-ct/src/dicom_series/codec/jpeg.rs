//! JPEG: baseline and extended DCT of 8 and 12 bits, lossless of 2 to 16 bits (ISO/IEC 10918-1).

use libjpeg_turbo_rs::precision::{decompress_12bit, decompress_lossless_arbitrary};
use libjpeg_turbo_rs::{Decoder, JpegError, PixelFormat};

use super::{CodecError, contain, expect_frame, expect_memory};
use crate::dicom_series::header::Image;

/// Memory of the decoder per pixel: coefficients and samples.
const BYTES_PER_PIXEL: usize = 12;

/// Contents of the start-of-frame segment.
struct Frame {
    lossless: bool,
    bits: u8,
}

pub(super) fn unpack(packed: &[u8], image: &Image) -> Result<Vec<u8>, CodecError> {
    let frame = frame(packed, image)?;
    expect_memory(image, BYTES_PER_PIXEL)?;
    match frame {
        Frame { lossless: true, .. } => {
            let decoded = decompress_lossless_arbitrary(packed).map_err(damaged)?;
            contain(decoded.data.iter().map(|&v| v.into()), image)
        }
        Frame { bits: 12, .. } => {
            let decoded = decompress_12bit(packed).map_err(damaged)?;
            contain(decoded.data.iter().map(|&v| v as u32), image)
        }
        Frame { .. } => {
            let mut decoder = Decoder::new(packed).map_err(damaged)?;
            decoder.set_output_format(PixelFormat::Grayscale);
            decoder.set_stop_on_warning(true);
            let decoded = decoder.decode_image().map_err(damaged)?;
            contain(decoded.data.iter().map(|&v| v.into()), image)
        }
    }
}

/// Finds the start of the frame and compares it with the header (section B.2.2).
fn frame(packed: &[u8], image: &Image) -> Result<Frame, CodecError> {
    let mut rest = packed.strip_prefix(&[0xff, 0xd8]).ok_or_else(no_frame)?;
    loop {
        let [0xff, marker, high, low, tail @ ..] = rest else {
            return Err(no_frame());
        };
        match marker {
            0xff => {
                rest = &rest[1..];
                continue;
            }
            0xc0 | 0xc1 | 0xc3 => {
                let [bits, y1, y0, x1, x0, components, ..] = tail else {
                    return Err(no_frame());
                };
                let size = [[*x1, *x0], [*y1, *y0]].map(|v| u16::from_be_bytes(v).into());
                expect_frame(size, (*components).into(), (*bits).into(), image)?;
                return Ok(Frame {
                    lossless: *marker == 0xc3,
                    bits: *bits,
                });
            }
            0xc2 | 0xc5..=0xc7 | 0xc9..=0xcf => {
                return Err(CodecError::Unexpected {
                    found: format!("a frame of type {}", marker - 0xc0),
                    expected: "0, 1 or 3 (sequential or lossless, Huffman codes)".to_owned(),
                });
            }
            _ => {}
        }
        let length = usize::from(u16::from_be_bytes([*high, *low]));
        rest = rest.get(2 + length..).ok_or_else(no_frame)?;
    }
}

fn no_frame() -> CodecError {
    CodecError::Damaged("no frame found".to_owned())
}

fn damaged(error: JpegError) -> CodecError {
    CodecError::Damaged(error.to_string())
}
