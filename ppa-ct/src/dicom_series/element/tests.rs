//! Parsing of complete and damaged elements and items.

use super::*;
use proptest::prelude::*;

const SEQUENCE: Tag = Tag(0x0040, 0x0100);
const TEXT: Tag = Tag(0x0008, 0x0060);

/// An explicit little-endian element.
fn element(tag: Tag, vr: &[u8; 2], value: &[u8], delimited: bool) -> Vec<u8> {
    let mut bytes = [tag.0.to_le_bytes(), tag.1.to_le_bytes(), *vr].concat();
    if has_short_length(vr) {
        bytes.extend((value.len() as u16).to_le_bytes());
    } else {
        bytes.extend([0, 0]);
        let length = if delimited {
            u32::MAX
        } else {
            value.len() as u32
        };
        bytes.extend(length.to_le_bytes());
    }
    bytes.extend(value);
    if delimited {
        bytes.extend(b"\xfe\xff\xdd\xe0\0\0\0\0");
    }
    bytes
}

fn item(value: &[u8], delimited: bool) -> Vec<u8> {
    let length = if delimited {
        u32::MAX
    } else {
        value.len() as u32
    };
    let mut bytes = [b"\xfe\xff\x00\xe0".as_slice(), &length.to_le_bytes(), value].concat();
    if delimited {
        bytes.extend(b"\xfe\xff\x0d\xe0\0\0\0\0");
    }
    bytes
}

fn nested(delimited: [bool; 2], texts: &[String]) -> Vec<u8> {
    let items = texts
        .iter()
        .map(|t| item(&element(TEXT, b"CS", t.as_bytes(), false), delimited[1]));
    let sequence = element(
        SEQUENCE,
        b"SQ",
        &items.collect::<Vec<_>>().concat(),
        delimited[0],
    );
    [
        element(TEXT, b"CS", b"CT", false),
        sequence,
        element(Tag(0x7fe0, 0x10), b"OW", b"1234", false),
    ]
    .concat()
}

proptest! {
    /// Both ways to end sequences and items give the same elements, and truncated bytes are refused.
    #[test]
    fn items_are_found_and_cut_bytes_are_not_read(
        delimited in any::<[bool; 2]>(),
        texts in prop::collection::vec("[A-Z]{0,9}", 0..4),
        cut in any::<prop::sample::Index>(),
    ) {
        let bytes = nested(delimited, &texts);
        let pixels = |tag: Tag| tag.0 == 0x7fe0;
        let (set, end) = DataSet::parse(&bytes, 0, Encoding::ExplicitLittle, pixels).unwrap();
        prop_assert_eq!(end, bytes.len() - 16);
        prop_assert_eq!(set.get(TEXT), Some(b"CT".as_slice()));
        let found = set.items(SEQUENCE).unwrap();
        let found = found.iter().map(|i| i.get(TEXT).unwrap().to_vec()).collect::<Vec<_>>();
        prop_assert_eq!(found, texts.iter().map(|t| t.clone().into_bytes()).collect::<Vec<_>>());

        let cut = cut.index(end);
        let parsed = DataSet::parse(&bytes[..cut], 0, Encoding::ExplicitLittle, pixels);
        // Complete elements may remain; a cut one is too short.
        prop_assert!(cut == 0 || cut == 10 || parsed.unwrap_err() == Fault::Short);
    }

    #[test]
    fn damage_never_panics(
        texts in prop::collection::vec("[A-Z]{0,9}", 0..4),
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        encoding in prop::sample::select(vec![Encoding::ExplicitLittle, Encoding::ImplicitLittle, Encoding::ExplicitBig]),
    ) {
        let mut bytes = nested([true, true], &texts);
        for (at, byte) in damage {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if let Ok((set, _)) = DataSet::parse(&bytes, 0, encoding, |_| false) {
            let _ = set.items(SEQUENCE);
        }
    }
}

#[test]
fn endless_nesting_is_refused() {
    let opened = [element(SEQUENCE, b"UN", b"", true), item(b"", true)].concat();
    // Without the delimiter of the sequence, with the item before and after it.
    let mut bytes = [&opened[..12], &opened[20..28]].concat();
    for _ in 0..100_000 {
        bytes.extend(b"\x40\0\0\x01\xff\xff\xff\xff\xfe\xff\x00\xe0\xff\xff\xff\xff");
    }
    let parsed = DataSet::parse(&bytes, 0, Encoding::ExplicitLittle, |_| false);
    assert!(matches!(parsed.unwrap_err(), Fault::Damaged(_)));
}
