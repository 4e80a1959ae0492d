//! One DICOM file: its encoding, its header in memory, its pixels where they lie.

use std::borrow::Cow;
use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use dicom_core::Tag;
use dicom_dictionary_std::{tags, uids};

use super::element::{DataSet, Encoding, Fault, header};
use super::syntax;
use crate::error::ReadError;

/// Preamble and `DICM` (PS3.10, section 7.1).
const META_AT: usize = 132;
/// Headers are a few kilobytes long; longer ones are read in further steps.
const FIRST_BYTES: u64 = 1 << 16;
/// Deflate packs at most 1032 bytes into one (zlib technical details), so this refuses no right file.
const INFLATES_AT_MOST: u64 = 1032;

/// A DICOM file whose header was found whole.
#[derive(Debug)]
pub(super) struct DicomFile {
    pub path: PathBuf,
    /// Transfer syntax UID.
    pub syntax: String,
    pub encoding: Encoding,
    /// SOP class of the meta group, empty when it is missing.
    pub sop_class: String,
    pixels: Option<PixelData>,
    /// What follows the start of the pixels, for files of several frames that cannot be read piecewise.
    held: Option<Vec<u8>>,
}

/// Where the value of Pixel Data lies.
#[derive(Debug, Clone, Copy)]
struct PixelData {
    /// In the file, or in the inflated data set.
    at: u64,
    /// `None` for fragments.
    length: Option<u64>,
    /// Bytes that follow `at`.
    rest: u64,
    /// Bytes per number, which big-endian files swap.
    word: usize,
}

/// A file with the bytes of its header.
pub(super) struct Opened {
    pub file: DicomFile,
    bytes: Vec<u8>,
    data_set_at: usize,
}

/// Reads a file up to its pixels.
pub(super) fn open(path: &Path) -> Result<Opened, ReadError> {
    let io = |source| ReadError::Io {
        path: path.to_owned(),
        source,
    };
    let mut file = File::open(path).map_err(io)?;
    let length = file.metadata().map_err(io)?.len();
    let mut bytes = Vec::new();
    read_up_to(&mut file, FIRST_BYTES, &mut bytes).map_err(io)?;

    let damaged = |fault| damaged(path, fault);
    if bytes.get(META_AT - 4..META_AT) != Some(b"DICM") {
        return Err(damaged(Fault::Damaged(0)));
    }
    // The group is walked to its end: some writers leave a wrong group length, or titles longer than allowed.
    let (meta, data_set_at) =
        DataSet::parse(&bytes, META_AT, Encoding::ExplicitLittle, |tag| tag.0 != 2)
            .map_err(damaged)?;
    let uid = |tag| meta.get(tag).map(text).unwrap_or_default();
    let syntax = uid(tags::TRANSFER_SYNTAX_UID);
    let mut opened = Opened {
        file: DicomFile {
            path: path.to_owned(),
            encoding: syntax::encoding(path, &syntax)?,
            sop_class: uid(tags::MEDIA_STORAGE_SOP_CLASS_UID),
            syntax,
            pixels: None,
            held: None,
        },
        bytes,
        data_set_at,
    };
    let total = if opened.file.is_deflated() {
        opened.bytes = inflate(path, data_set_at as u64)?;
        opened.data_set_at = 0;
        opened.bytes.len() as u64
    } else {
        length
    };
    loop {
        match find_pixels(&opened, total) {
            Ok(pixels) => {
                opened.file.pixels = pixels;
                return Ok(opened);
            }
            Err(Fault::Short) if (opened.bytes.len() as u64) < total => {
                let more = 3 * opened.bytes.len() as u64;
                read_up_to(&mut file, more, &mut opened.bytes).map_err(io)?;
            }
            Err(fault) => return Err(damaged(fault)),
        }
    }
}

fn find_pixels(opened: &Opened, total: u64) -> Result<Option<PixelData>, Fault> {
    let (bytes, encoding) = (&opened.bytes[..], opened.file.encoding);
    let (_, at) = DataSet::parse(bytes, opened.data_set_at, encoding, is_pixel_data)?;
    if at == bytes.len() {
        // The end of the bytes may be an accidental border of elements.
        let whole = bytes.len() as u64 == total;
        return if whole { Ok(None) } else { Err(Fault::Short) };
    }
    let start = header(bytes, at, encoding)?;
    let rest = total.saturating_sub(start.value_at as u64);
    let length = start.length.map(|length| length as u64);
    if length.is_some_and(|length| rest < length) {
        return Err(Fault::Short);
    }
    Ok(Some(PixelData {
        at: start.value_at as u64,
        length,
        rest,
        word: match start.vr.as_ref() {
            Some(b"OB" | b"UN") => 1,
            Some(b"OL") => 4,
            _ => 2,
        },
    }))
}

fn is_pixel_data(tag: Tag) -> bool {
    tag == tags::PIXEL_DATA
}

impl Opened {
    /// The elements in front of the pixels.
    pub fn data_set(&self) -> Result<DataSet<'_>, ReadError> {
        DataSet::parse(
            &self.bytes,
            self.data_set_at,
            self.file.encoding,
            is_pixel_data,
        )
        .map(|(set, _)| set)
        .map_err(|fault| damaged(&self.file.path, fault))
    }

    /// The file alone; one of several frames keeps its pixels if they cannot be read piecewise.
    pub fn into_file(mut self, frames: usize) -> Result<DicomFile, ReadError> {
        let whole = self.file.is_deflated() || !self.file.is_native();
        if frames > 1 && whole && self.file.pixels.is_some() {
            self.file.held = Some(self.file.rest()?.into_owned());
        }
        Ok(self.file)
    }
}

impl DicomFile {
    fn is_deflated(&self) -> bool {
        self.syntax == uids::DEFLATED_EXPLICIT_VR_LITTLE_ENDIAN
    }

    /// Whether pixels are stored as they are, not as compressed fragments.
    pub fn is_native(&self) -> bool {
        self.pixels.is_none_or(|pixels| pixels.length.is_some())
    }

    /// Bytes of the stored pixels, compressed or not.
    pub fn pixel_bytes(&self) -> Result<u64, ReadError> {
        let pixels = self.pixel_data()?;
        Ok(pixels.length.unwrap_or(pixels.rest))
    }

    fn pixel_data(&self) -> Result<PixelData, ReadError> {
        self.pixels.ok_or_else(|| ReadError::MissingTag {
            path: self.path.clone(),
            tag: "PixelData",
        })
    }

    /// Everything from the start of the pixels on.
    pub fn rest(&self) -> Result<Cow<'_, [u8]>, ReadError> {
        if let Some(held) = &self.held {
            return Ok(Cow::Borrowed(held));
        }
        let pixels = self.pixel_data()?;
        let mut bytes = Vec::new();
        if self.is_deflated() {
            bytes = open(&self.path)?.bytes;
            bytes.drain(..pixels.at as usize);
        } else {
            self.read_at(pixels.at, pixels.rest, &mut bytes)?;
        }
        Ok(Cow::Owned(bytes))
    }

    /// Reads `length` native bytes from byte `from` of the pixels on, as little-endian numbers.
    pub fn native(&self, from: u64, length: u64, bytes: &mut Vec<u8>) -> Result<(), ReadError> {
        let pixels = self.pixel_data()?;
        if self.is_deflated() {
            bytes.clear();
            let rest = self.rest()?;
            let part = rest.get(from as usize..(from + length) as usize);
            bytes.extend_from_slice(part.ok_or_else(|| damaged(&self.path, Fault::Short))?);
        } else {
            self.read_at(pixels.at + from, length, bytes)?;
        }
        if self.encoding == Encoding::ExplicitBig && pixels.word > 1 {
            bytes
                .chunks_exact_mut(pixels.word)
                .for_each(<[u8]>::reverse);
        }
        Ok(())
    }

    fn read_at(&self, at: u64, length: u64, bytes: &mut Vec<u8>) -> Result<(), ReadError> {
        let io = |source| ReadError::Io {
            path: self.path.clone(),
            source,
        };
        let mut file = File::open(&self.path).map_err(io)?;
        file.seek(SeekFrom::Start(at)).map_err(io)?;
        // The length was there when the header was read.
        bytes.resize(length as usize, 0);
        file.read_exact(bytes).map_err(|error| match error.kind() {
            ErrorKind::UnexpectedEof => damaged(&self.path, Fault::Short),
            _ => io(error),
        })
    }
}

/// Appends at most `most` bytes.
fn read_up_to(file: &mut File, most: u64, bytes: &mut Vec<u8>) -> std::io::Result<()> {
    let left = file
        .metadata()?
        .len()
        .saturating_sub(file.stream_position()?);
    bytes.reserve(left.min(most) as usize);
    file.take(most).read_to_end(bytes).map(|_| ())
}

/// The inflated data set of a file.
fn inflate(path: &Path, data_set_at: u64) -> Result<Vec<u8>, ReadError> {
    let io = |source| ReadError::Io {
        path: path.to_owned(),
        source,
    };
    let mut file = File::open(path).map_err(io)?;
    file.seek(SeekFrom::Start(data_set_at)).map_err(io)?;
    let packed = file
        .metadata()
        .map_err(io)?
        .len()
        .saturating_sub(data_set_at);
    let mut bytes = Vec::new();
    flate2::read::DeflateDecoder::new(std::io::BufReader::new(file))
        .take(packed.saturating_mul(INFLATES_AT_MOST))
        .read_to_end(&mut bytes)
        .map_err(|error| ReadError::Dicom {
            path: path.to_owned(),
            source: Box::new(error),
        })?;
    Ok(bytes)
}

/// Our error for a damaged file.
pub(super) fn damaged(path: &Path, fault: Fault) -> ReadError {
    ReadError::Dicom {
        path: path.to_owned(),
        source: Box::new(fault),
    }
}

/// A value as text without padding.
pub(super) fn text(value: &[u8]) -> String {
    let text = String::from_utf8_lossy(value);
    let padding = |c: char| c.is_whitespace() || c == '\0';
    text.trim_matches(padding).to_owned()
}
