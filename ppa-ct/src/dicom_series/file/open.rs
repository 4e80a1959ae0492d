//! A DICOM file up to its pixels.

use std::io::Read;
use std::path::Path;
use std::sync::OnceLock;

use dicom_core::Tag;
use dicom_dictionary_std::{tags, uids};

use super::super::element::{DataSet, ElementHeader, Encoding, Fault, header};
use super::super::syntax;
use super::{DicomFile, PixelData, damaged, text, undeflatable};
use crate::error::ReadError;

/// Preamble and `DICM` (PS3.10, section 7.1).
const META_AT: usize = 132;
/// Bytes read first: headers are a few kilobytes long; longer ones are read in further steps.
const FIRST_BYTES: u64 = 1 << 16;
/// Deflate packs at most 1032 bytes into one (zlib technical details), so no valid file is refused.
const INFLATES_AT_MOST: u64 = 1032;
/// Largest number of bytes inflated in search of a header's end.
const LONGEST_DEFLATED: u64 = 1 << 26;

/// A file with the bytes of its header.
pub(in crate::dicom_series) struct Opened {
    pub file: DicomFile,
    bytes: Vec<u8>,
    data_set_at: usize,
}

/// Reads a file up to its pixels.
pub(in crate::dicom_series) fn open(path: &Path) -> Result<Opened, ReadError> {
    let io = |source| ReadError::Io {
        path: path.to_owned(),
        source,
    };
    let mut file = ppa_core::regular_file::open(path).map_err(io)?;
    let length = file.metadata().map_err(io)?.len();
    let mut bytes = Vec::new();
    (&mut file)
        .take(FIRST_BYTES)
        .read_to_end(&mut bytes)
        .map_err(io)?;

    let damaged = |fault| damaged(path, fault);
    if bytes.get(META_AT - 4..META_AT) != Some(b"DICM") {
        return Err(damaged(Fault::Damaged(0)));
    }
    // The group is read element by element: some writers leave a wrong group length, or titles longer than allowed.
    let (meta, data_set_at) =
        DataSet::parse(&bytes, META_AT, Encoding::ExplicitLittle, |tag| tag.0 != 2)
            .map_err(damaged)?;
    let uid = |tag| meta.get(tag).map(text).unwrap_or_default();
    let syntax = uid(tags::TRANSFER_SYNTAX_UID);
    let sop_class = uid(tags::MEDIA_STORAGE_SOP_CLASS_UID);
    let encoding = syntax::encoding(path, &syntax)?;
    let deflated = syntax == uids::DEFLATED_EXPLICIT_VR_LITTLE_ENDIAN;
    let mut opened = Opened {
        file: DicomFile {
            path: path.to_owned(),
            syntax,
            encoding,
            sop_class,
            pixels: None,
            deflated_at: deflated.then_some(data_set_at as u64),
            held: OnceLock::new(),
        },
        bytes,
        data_set_at,
    };
    let start = if deflated {
        (opened.bytes, opened.data_set_at) = (Vec::new(), 0);
        let mut stream = opened.file.inflated()?;
        let found = find_pixels(
            &mut stream,
            &mut opened.bytes,
            0,
            encoding,
            LONGEST_DEFLATED,
        );
        found.map_err(|error| undeflatable(path, error))?
    } else {
        let found = find_pixels(
            &mut file,
            &mut opened.bytes,
            data_set_at,
            encoding,
            u64::MAX,
        );
        found.map_err(io)?
    };
    let Some(start) = start.map_err(damaged)? else {
        return Ok(opened);
    };
    let at = start.value_at as u64;
    let rest = length.saturating_sub(at);
    let pixels = start.length.map(|length| length as u64);
    // The size of a deflated file is known only when its pixels are read; they are not fragments.
    let most = if deflated {
        length.saturating_mul(INFLATES_AT_MOST)
    } else {
        rest
    };
    let whole = pixels.map_or(!deflated, |pixels| pixels <= most);
    if !whole {
        return Err(damaged(Fault::Short));
    }
    opened.file.pixels = Some(PixelData {
        at,
        length: pixels,
        rest,
        word: match start.vr.as_ref() {
            Some(b"OB" | b"UN") => 1,
            Some(b"OL") => 4,
            _ => 2,
        },
    });
    Ok(opened)
}

/// Reads on until `bytes` contains the start of the pixels; returns `None` if the stream ends without any.
fn find_pixels(
    stream: &mut dyn Read,
    bytes: &mut Vec<u8>,
    data_set_at: usize,
    encoding: Encoding,
    most: u64,
) -> std::io::Result<Result<Option<ElementHeader>, Fault>> {
    loop {
        let found = start_of_pixels(bytes, data_set_at, encoding);
        // The end of the bytes may coincide with the end of an element.
        if !matches!(found, Ok(None) | Err(Fault::Short)) {
            return Ok(found);
        }
        let read = bytes.len() as u64;
        if read >= most {
            return Ok(Err(Fault::Endless(most)));
        }
        let more = (3 * read).max(FIRST_BYTES);
        stream.take(more).read_to_end(bytes)?;
        if bytes.len() as u64 == read {
            return Ok(found);
        }
    }
}

fn start_of_pixels(
    bytes: &[u8],
    data_set_at: usize,
    encoding: Encoding,
) -> Result<Option<ElementHeader>, Fault> {
    let (_, at) = DataSet::parse(bytes, data_set_at, encoding, is_pixel_data)?;
    match at == bytes.len() {
        true => Ok(None),
        false => header(bytes, at, encoding).map(Some),
    }
}

fn is_pixel_data(tag: Tag) -> bool {
    tag == tags::PIXEL_DATA
}

impl Opened {
    /// The elements before the pixels.
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
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::DeflateEncoder;

    use super::*;

    /// Reading ends with the bytes, whatever length the file had when it was opened.
    #[test]
    fn the_search_for_pixels_ends_with_the_stream() {
        let element = b"\x10\0\x10\0PN\x04\0Doe ";
        let find = |stream: &[u8], most| {
            let mut bytes = Vec::new();
            find_pixels(&mut &*stream, &mut bytes, 0, Encoding::ExplicitLittle, most).unwrap()
        };
        assert_eq!(find(element, u64::MAX), Ok(None));
        assert_eq!(find(&element[..10], u64::MAX), Err(Fault::Short));
        let many = element.repeat(1 << 16);
        assert_eq!(find(&many, u64::MAX), Ok(None));
        assert_eq!(find(&many, 1 << 17), Err(Fault::Endless(1 << 17)));
        let pixels = [&many, &b"\xe0\x7f\x10\0OW\0\0\x02\0\0\0ab"[..]].concat();
        let start = find(&pixels, u64::MAX).unwrap().unwrap();
        assert_eq!((start.value_at, start.length), (many.len() + 12, Some(2)));
    }

    fn deflated(path: &Path, data_set: &[u8]) {
        let uid = b"\x02\0\x10\0UI\x16\x001.2.840.10008.1.2.1.99";
        let mut file = [&[0; 128], &b"DICM"[..], uid].concat();
        let mut encoder = DeflateEncoder::new(&mut file, Compression::fast());
        encoder.write_all(data_set).unwrap();
        encoder.finish().unwrap();
        std::fs::write(path, &file).unwrap();
    }

    /// Of a deflated file only the header is inflated, and later the pixels that it specifies.
    #[test]
    fn a_deflated_file_is_inflated_as_far_as_its_header_asks() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bomb");
        let mut data_set = b"\xe0\x7f\x10\0OW\0\0\x04\0\0\0abcd".to_vec();
        data_set.resize(1 << 26, 0);
        deflated(&path, &data_set);
        assert!(path.metadata().unwrap().len() < 1 << 20);
        let opened = open(&path).unwrap();
        assert!(opened.bytes.len() < 1 << 17, "{} bytes", opened.bytes.len());
        assert_eq!(opened.file.pixel_bytes().unwrap(), 4);
        let mut pixels = Vec::new();
        opened.file.native(2, 2, &mut pixels).unwrap();
        assert_eq!(pixels, b"cd");
        opened.file.hold().unwrap();
        opened.file.native(1, 2, &mut pixels).unwrap();
        assert_eq!(pixels, b"bc");
    }

    /// 2 GiB in a file of some hundred bytes are more than any deflate stream holds; a hundred thousand bytes are not.
    #[test]
    fn a_deflated_file_shorter_than_its_header_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("empty");
        deflated(&path, b"\xe0\x7f\x10\0OW\0\0\0\0\0\x80ab");
        assert!(open(&path).is_err());
        deflated(&path, b"\xe0\x7f\x10\0OW\0\0\xa0\x86\x01\0ab");
        let file = open(&path).unwrap().file;
        let mut pixels = Vec::new();
        assert!(file.native(0, 2, &mut pixels).is_ok());
        assert!(file.native(0, 100_000, &mut pixels).is_err());
        assert!(pixels.capacity() < 100_000 && file.hold().is_err());
    }
}
