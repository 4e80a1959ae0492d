//! One DICOM file: its encoding, and the location of its pixels.

mod open;

use std::borrow::Cow;
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use flate2::bufread::DeflateDecoder;

use super::element::{Encoding, Fault};
use crate::error::ReadError;
pub(super) use open::open;

/// A DICOM file with a complete header.
#[derive(Debug)]
pub(super) struct DicomFile {
    pub path: PathBuf,
    /// Transfer syntax UID.
    pub syntax: String,
    pub encoding: Encoding,
    /// SOP class of the meta group, empty when it is missing.
    pub sop_class: String,
    pixels: Option<PixelData>,
    /// Start of the data set in the file, if it is deflated from there on.
    deflated_at: Option<u64>,
    /// All pixels of a multi-frame file that cannot be read frame by frame, loaded when first needed.
    held: OnceLock<Vec<u8>>,
}

/// Location of the value of Pixel Data.
#[derive(Debug, Clone, Copy)]
struct PixelData {
    /// Offset in the file, or in the inflated data set.
    at: u64,
    /// `None` for fragments.
    length: Option<u64>,
    /// Bytes of the file from `at` on.
    rest: u64,
    /// Bytes per number, which big-endian files swap.
    word: usize,
}

impl DicomFile {
    /// Whether pixels are stored uncompressed, not as compressed fragments.
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

    /// Loads the pixels into memory if reading one frame of several requires all of them.
    pub fn hold(&self) -> Result<(), ReadError> {
        let pixels = self.pixel_data()?;
        let mut bytes = Vec::new();
        match pixels.length {
            Some(length) if self.deflated_at.is_some() => {
                self.read(pixels.at, length, &mut bytes)?
            }
            Some(_) => return Ok(()),
            None => self.read(pixels.at, pixels.rest, &mut bytes)?,
        }
        self.held.get_or_init(|| bytes);
        Ok(())
    }

    /// All fragments, starting with the offset table.
    pub fn fragments(&self) -> Result<Cow<'_, [u8]>, ReadError> {
        if let Some(held) = self.held.get() {
            return Ok(Cow::Borrowed(held));
        }
        let pixels = self.pixel_data()?;
        let mut bytes = Vec::new();
        self.read(pixels.at, pixels.rest, &mut bytes)?;
        Ok(Cow::Owned(bytes))
    }

    /// Reads `length` native bytes from byte `from` of the pixels, as little-endian numbers.
    pub fn native(&self, from: u64, length: u64, bytes: &mut Vec<u8>) -> Result<(), ReadError> {
        let pixels = self.pixel_data()?;
        if let Some(held) = self.held.get() {
            bytes.clear();
            bytes.extend_from_slice(&held[from as usize..(from + length) as usize]);
            return Ok(());
        }
        if self.encoding != Encoding::ExplicitBig || pixels.word == 1 {
            return self.read(pixels.at + from, length, bytes);
        }
        // Frames of an odd number of 8-bit pixels share a word with the next one.
        let word = pixels.word as u64;
        let before = from % word;
        let end = (from + length).next_multiple_of(word);
        let end = end.min(pixels.length.unwrap_or(end));
        self.read(pixels.at + from - before, end - (from - before), bytes)?;
        bytes
            .chunks_exact_mut(pixels.word)
            .for_each(<[u8]>::reverse);
        bytes.drain(..before as usize);
        bytes.truncate(length as usize);
        Ok(())
    }

    /// Reads `length` bytes from byte `at` of the file, or of its inflated contents.
    fn read(&self, at: u64, length: u64, bytes: &mut Vec<u8>) -> Result<(), ReadError> {
        let short = || damaged(&self.path, Fault::Short);
        if self.deflated_at.is_some() {
            // Memory grows with the data read, since their length is not known before.
            let mut stream = self.inflated()?;
            bytes.clear();
            let skipped = std::io::copy(&mut (&mut stream).take(at), &mut std::io::sink());
            let read = skipped.and_then(|_| stream.take(length).read_to_end(bytes));
            let read = read.map_err(|error| undeflatable(&self.path, error))?;
            return if read as u64 == length {
                Ok(())
            } else {
                Err(short())
            };
        }
        let mut file = ppa_core::regular_file::open(&self.path).map_err(|e| self.io(e))?;
        file.seek(SeekFrom::Start(at)).map_err(|e| self.io(e))?;
        // The length was checked when the header was read.
        bytes.resize(length as usize, 0);
        file.read_exact(bytes).map_err(|error| match error.kind() {
            ErrorKind::UnexpectedEof => short(),
            _ => self.io(error),
        })
    }

    /// The data set of a deflated file, from its start.
    fn inflated(&self) -> Result<impl Read + use<>, ReadError> {
        let mut file = ppa_core::regular_file::open(&self.path).map_err(|e| self.io(e))?;
        let at = SeekFrom::Start(self.deflated_at.unwrap_or_default());
        file.seek(at).map_err(|e| self.io(e))?;
        Ok(DeflateDecoder::new(BufReader::new(file)))
    }

    fn io(&self, source: std::io::Error) -> ReadError {
        ReadError::Io {
            path: self.path.clone(),
            source,
        }
    }
}

fn undeflatable(path: &Path, error: std::io::Error) -> ReadError {
    ReadError::Dicom {
        path: path.to_owned(),
        source: Box::new(error),
    }
}

/// Converts a fault to the error for a damaged file.
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
