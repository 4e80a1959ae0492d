//! Positions of the elements of a DICOM data set in its bytes (PS3.5, section 7).
//!
//! Lengths are followed only as far as the bytes reach and nothing is copied. A damaged length is therefore an error and reserves no memory
//! (dicom-object reserves whatever length a file claims, up to 4 GiB), and pixels are read in place.
//! A series of 512 slices takes a quarter of SimpleITK's processor time and 0.29 of its memory (bench `dicom`,
//! docs/performance.md).

use std::ops::Range;

use dicom_core::{Tag, VR};

/// Encoding of elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    ImplicitLittle,
    ExplicitLittle,
    ExplicitBig,
}

/// Why bytes are not a valid data set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(super) enum Fault {
    /// An element continues beyond the last byte.
    #[error("an element extends beyond the end of the data")]
    Short,
    /// Not an element, or sequences nested too deeply.
    #[error("no valid element begins at byte {0} of the data set")]
    Damaged(usize),
    /// A deflated header that is unreasonably long.
    #[error("no pixel data in the first {0} bytes after inflating")]
    Endless(u64),
}

/// Deepest nesting of sequences accepted; real files reach five.
pub(super) const DEEPEST: usize = 16;
const ITEM: Tag = Tag(0xfffe, 0xe000);
const ITEM_END: Tag = Tag(0xfffe, 0xe00d);
const SEQUENCE_END: Tag = Tag(0xfffe, 0xe0dd);

impl Encoding {
    pub fn u16(self, bytes: [u8; 2]) -> u16 {
        match self {
            Self::ExplicitBig => u16::from_be_bytes(bytes),
            _ => u16::from_le_bytes(bytes),
        }
    }

    pub fn u32(self, bytes: [u8; 4]) -> u32 {
        match self {
            Self::ExplicitBig => u32::from_be_bytes(bytes),
            _ => u32::from_le_bytes(bytes),
        }
    }
}

/// The start of an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ElementHeader {
    pub tag: Tag,
    /// Value representation; `None` if it is not stored.
    pub vr: Option<[u8; 2]>,
    /// First byte of the value.
    pub value_at: usize,
    /// Length of the value in bytes; `None` for a sequence that is ended by a delimiter.
    pub length: Option<usize>,
}

/// An element that is completely contained in the bytes.
#[derive(Debug)]
pub(super) struct Element {
    pub tag: Tag,
    vr: Option<[u8; 2]>,
    value: Range<usize>,
}

impl Element {
    /// Value representation, if it is stored.
    pub fn vr(&self) -> Option<VR> {
        self.vr.and_then(VR::from_binary)
    }
}

/// The elements of one data set or item.
#[derive(Debug)]
pub(super) struct DataSet<'a> {
    bytes: &'a [u8],
    elements: Vec<Element>,
    encoding: Encoding,
}

impl<'a> DataSet<'a> {
    /// Finds the elements from byte `at` on, up to the first for which `stop` is true, or to the end;
    /// also returns the end position.
    pub fn parse(
        bytes: &'a [u8],
        mut at: usize,
        encoding: Encoding,
        stop: impl Fn(Tag) -> bool,
    ) -> Result<(Self, usize), Fault> {
        let mut elements = Vec::new();
        while at < bytes.len() {
            if stop(tag(bytes, at, encoding)?) {
                break;
            }
            let header = header(bytes, at, encoding)?;
            let end = end_of(bytes, &header, encoding, 0)?;
            elements.push(Element {
                tag: header.tag,
                vr: header.vr,
                value: header.value_at..end,
            });
            at = end;
        }
        let found = Self {
            bytes,
            elements,
            encoding,
        };
        Ok((found, at))
    }

    /// Returns the value of an element; `None` when it is absent.
    pub fn get(&self, tag: Tag) -> Option<&'a [u8]> {
        self.find(tag).map(|element| self.value(element))
    }

    /// Returns the value of one of the data set's elements.
    pub fn value(&self, element: &Element) -> &'a [u8] {
        &self.bytes[element.value.clone()]
    }

    fn find(&self, tag: Tag) -> Option<&Element> {
        self.elements.iter().find(|element| element.tag == tag)
    }

    /// All elements; a damaged file may contain a tag more than once.
    pub fn elements(&self) -> &[Element] {
        &self.elements
    }

    /// Encoding of the numbers in it.
    pub fn encoding(&self) -> Encoding {
        self.encoding
    }

    /// Returns the items of a sequence; empty when it is absent.
    pub fn items(&self, sequence: Tag) -> Result<Vec<DataSet<'a>>, Fault> {
        let found = self.find(sequence);
        found.map_or(Ok(Vec::new()), |element| self.items_of(element))
    }

    /// Returns the items of one of the data set's elements.
    pub fn items_of(&self, element: &Element) -> Result<Vec<DataSet<'a>>, Fault> {
        let encoding = inside(element.vr, self.encoding);
        let bytes = &self.bytes[..element.value.end];
        let (mut items, mut at) = (Vec::new(), element.value.start);
        while at < bytes.len() {
            let item = header(bytes, at, encoding)?;
            match item.tag {
                ITEM => {
                    let end = end_of(bytes, &item, encoding, 0)?;
                    let stop = |tag| tag == ITEM_END;
                    items.push(Self::parse(&bytes[..end], item.value_at, encoding, stop)?.0);
                    at = end;
                }
                SEQUENCE_END => break,
                _ => return Err(Fault::Damaged(at)),
            }
        }
        Ok(items)
    }
}

/// Reads the start of the element at byte `at`.
pub(super) fn header(bytes: &[u8], at: usize, encoding: Encoding) -> Result<ElementHeader, Fault> {
    let tag = tag(bytes, at, encoding)?;
    let short = |from: usize| Ok(usize::from(encoding.u16(array(bytes, from)?)));
    let long = |from: usize| -> Result<_, Fault> {
        let length = encoding.u32(array(bytes, from)?);
        Ok((length != u32::MAX).then_some(length as usize))
    };
    let (vr, value_at, length) = if tag.0 == 0xfffe || encoding == Encoding::ImplicitLittle {
        (None, at + 8, long(at + 4)?)
    } else {
        let vr = array::<2>(bytes, at + 4)?;
        if !vr.iter().all(u8::is_ascii_uppercase) {
            return Err(Fault::Damaged(at));
        }
        if has_short_length(&vr) {
            (Some(vr), at + 8, Some(short(at + 6)?))
        } else {
            (Some(vr), at + 12, long(at + 8)?)
        }
    };
    Ok(ElementHeader {
        tag,
        vr,
        value_at,
        length,
    })
}

fn has_short_length(vr: &[u8; 2]) -> bool {
    #[rustfmt::skip]
    const SHORT: [&[u8; 2]; 20] = [
        b"AE", b"AS", b"AT", b"CS", b"DA", b"DS", b"DT", b"FL", b"FD", b"IS",
        b"LO", b"LT", b"PN", b"SH", b"SL", b"SS", b"ST", b"TM", b"UI", b"UL",
    ];
    vr == b"US" || SHORT.contains(&vr)
}

fn tag(bytes: &[u8], at: usize, encoding: Encoding) -> Result<Tag, Fault> {
    let half = |at| Ok(encoding.u16(array(bytes, at)?));
    Ok(Tag(half(at)?, half(at + 2)?))
}

fn array<const N: usize>(bytes: &[u8], at: usize) -> Result<[u8; N], Fault> {
    let found = bytes.get(at..).and_then(|rest| rest.first_chunk::<N>());
    found.copied().ok_or(Fault::Short)
}

/// Items of a sequence of unknown representation are written implicitly (PS3.5, section 6.2.2).
fn inside(vr: Option<[u8; 2]>, encoding: Encoding) -> Encoding {
    match vr {
        Some([b'U', b'N']) => Encoding::ImplicitLittle,
        _ => encoding,
    }
}

/// First byte after an element or item, including its delimiter.
fn end_of(
    bytes: &[u8],
    start: &ElementHeader,
    encoding: Encoding,
    depth: usize,
) -> Result<usize, Fault> {
    let mut at = start.value_at;
    if let Some(length) = start.length {
        let end = at.checked_add(length).filter(|end| *end <= bytes.len());
        return end.ok_or(Fault::Short);
    }
    if depth == DEEPEST {
        return Err(Fault::Damaged(at));
    }
    let encoding = inside(start.vr, encoding);
    let last = if start.tag == ITEM {
        ITEM_END
    } else {
        SEQUENCE_END
    };
    loop {
        let inner = header(bytes, at, encoding)?;
        if inner.tag == last {
            return Ok(inner.value_at);
        }
        // Items hold elements, sequences hold items.
        if (inner.tag.0 == 0xfffe) != (last == SEQUENCE_END) {
            return Err(Fault::Damaged(at));
        }
        at = end_of(bytes, &inner, encoding, depth + 1)?;
    }
}

#[cfg(test)]
mod tests;
