//! Decoding of compressed frames into little-endian samples.
//!
//! RLE and JPEG-LS are decoded here (no maintained pure-Rust crate decodes the latter), JPEG by libjpeg-turbo-rs and
//! JPEG 2000 by hayro-jpeg2000. All are Rust; sizes are compared with the header before any of them reserves memory.

mod jpeg;
mod jpeg_2000;
mod jpeg_ls;
mod rle;

use super::header::Image;
use crate::values::{with_room, zeros};
use crate::volume_error::VolumeError;

/// A family of encodings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Codec {
    Rle,
    Jpeg,
    JpegLs,
    Jpeg2000,
}

/// Why a frame cannot be decompressed.
#[derive(Debug, thiserror::Error)]
pub(super) enum CodecError {
    #[error("the compressed stream is damaged ({0})")]
    Damaged(String),
    #[error("the compressed stream holds {found}, expected {expected}")]
    Unexpected { found: String, expected: String },
    #[error(transparent)]
    Memory(#[from] VolumeError),
}

impl Codec {
    /// Decodes one frame into `image.native_bytes()` bytes.
    pub fn unpack(self, packed: &[u8], image: &Image) -> Result<Vec<u8>, CodecError> {
        match self {
            Self::Rle => {
                let mut values = zeros(image.native_bytes())?;
                rle::unpack(packed, image.stored.bytes(), &mut values)
                    .ok_or_else(|| CodecError::Damaged("run lengths".to_owned()))?;
                Ok(values)
            }
            Self::Jpeg => jpeg::unpack(packed, image),
            Self::JpegLs => jpeg_ls::unpack(packed, image),
            Self::Jpeg2000 => jpeg_2000::unpack(packed, image),
        }
    }

    /// Largest number of bytes that one byte of a valid stream can decode to: constant frames compress best.
    ///
    /// RLE expands 2 bytes to 128; a JPEG pixel takes at least a bit, a block of 8 x 8 pixels two. `None` if there is no
    /// bound: JPEG-LS codes an entire repeated line in one bit, and a JPEG 2000 frame may be empty.
    pub fn expands_at_most(self) -> Option<u64> {
        match self {
            Self::Rle => Some(64),
            Self::Jpeg => Some(1 << 10),
            Self::JpegLs | Self::Jpeg2000 => None,
        }
    }
}

/// Refuses a stream that is not a grey image of the size that the header states, or has more bits than its containers.
fn expect_frame(
    size: [usize; 2],
    components: usize,
    bits: u32,
    image: &Image,
) -> Result<(), CodecError> {
    let expected = [image.columns, image.rows];
    if size != expected {
        let text = |[columns, rows]: [usize; 2]| format!("{columns} x {rows} pixels");
        return Err(CodecError::Unexpected {
            found: text(size),
            expected: text(expected),
        });
    }
    expect_grey(components)?;
    if bits > image.stored.bits_allocated {
        return Err(CodecError::Unexpected {
            found: format!("samples of {bits} bits"),
            expected: format!("at most {}", image.stored.bits_allocated),
        });
    }
    Ok(())
}

/// Refuses a stream in colour.
fn expect_grey(components: usize) -> Result<(), CodecError> {
    if components == 1 {
        return Ok(());
    }
    Err(CodecError::Unexpected {
        found: format!("{components} components"),
        expected: "1 (grey)".to_owned(),
    })
}

/// Reads the next marker of a stream.
fn marker(rest: &mut &[u8]) -> Option<u8> {
    let [0xff, marker, tail @ ..] = *rest else {
        return None;
    };
    *rest = tail;
    Some(*marker)
}

/// Reads the body of a segment, after its length.
fn segment<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let (length, tail) = rest.split_first_chunk::<2>()?;
    let length = usize::from(u16::from_be_bytes(*length)).checked_sub(2)?;
    let (body, tail) = tail.split_at_checked(length)?;
    *rest = tail;
    Some(body)
}

/// Stores decoded samples in the containers of the header.
fn contain(
    samples: impl ExactSizeIterator<Item = u32>,
    image: &Image,
) -> Result<Vec<u8>, CodecError> {
    if samples.len() != image.pixels() {
        return Err(CodecError::Unexpected {
            found: format!("{} samples", samples.len()),
            expected: format!("{} (one per pixel)", image.pixels()),
        });
    }
    let mut bytes = zeros(image.native_bytes())?;
    match image.stored.bytes() {
        1 => {
            let places = bytes.iter_mut().zip(samples);
            places.for_each(|(place, v)| *place = v as u8);
        }
        2 => {
            let places = bytes.as_chunks_mut().0.iter_mut().zip(samples);
            places.for_each(|(place, v)| *place = (v as u16).to_le_bytes());
        }
        _ => {
            let places = bytes.as_chunks_mut().0.iter_mut().zip(samples);
            places.for_each(|(place, v)| *place = v.to_le_bytes());
        }
    }
    Ok(bytes)
}

/// Refuses an image if memory does not suffice to decode it on every thread: the decoder would abort the program.
fn expect_memory(image: &Image, bytes_per_pixel: usize) -> Result<(), CodecError> {
    let bytes = image.pixels().saturating_mul(bytes_per_pixel);
    with_room::<u8>(bytes.saturating_mul(rayon::current_num_threads()))?;
    Ok(())
}

#[cfg(test)]
const FOUR_BY_FOUR: Image = Image {
    columns: 4,
    rows: 4,
    frames: 1,
    stored: super::stored::StoredFormat {
        bits_allocated: 8,
        bits_stored: 8,
        high_bit: 7,
        signed: false,
        padding: None,
    },
};
