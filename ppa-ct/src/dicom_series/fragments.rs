//! Assignment of compressed fragments to frames (PS3.5, section A.4).

use std::borrow::Cow;

use dicom_core::Tag;

use super::element::{Encoding, Fault, header};

const ITEM: Tag = Tag(0xfffe, 0xe000);
const END: Tag = Tag(0xfffe, 0xe0dd);

/// The compressed bytes of one frame of `frames`.
///
/// `bytes` start after the length of Pixel Data; the first item is the offset table. Returns `None` for the frame if
/// fragments cannot be assigned: several per frame, and no table.
pub(super) fn of_frame(
    bytes: &[u8],
    index: usize,
    frames: usize,
) -> Result<Option<Cow<'_, [u8]>>, Fault> {
    let mut items = items(bytes)?.into_iter();
    let Some((_, table)) = items.next() else {
        return Ok(None);
    };
    let fragments = items.collect::<Vec<_>>();
    if frames == 1 {
        return Ok(match &fragments[..] {
            [] => None,
            [(_, only)] => Some(Cow::Borrowed(only)),
            several => Some(Cow::Owned(join(several))),
        });
    }
    if fragments.len() == frames {
        return Ok(Some(Cow::Borrowed(fragments[index].1)));
    }
    let (offsets, _) = table.as_chunks::<4>();
    if offsets.len() != frames {
        return Ok(None);
    }
    // Offsets are relative to the first fragment's item.
    let first = fragments.first().map_or(0, |(at, _)| *at);
    let from = |index: usize| first + u32::from_le_bytes(offsets[index]) as usize;
    let end = if index + 1 < frames {
        from(index + 1)
    } else {
        bytes.len()
    };
    let part = fragments
        .iter()
        .filter(|(at, _)| (from(index)..end).contains(at));
    let part = part.copied().collect::<Vec<_>>();
    Ok((!part.is_empty()).then(|| Cow::Owned(join(&part))))
}

/// All items with their start positions.
fn items(bytes: &[u8]) -> Result<Vec<(usize, &[u8])>, Fault> {
    let (mut items, mut at) = (Vec::new(), 0);
    loop {
        let item = header(bytes, at, Encoding::ExplicitLittle)?;
        match (item.tag, item.length) {
            (END, _) => return Ok(items),
            (ITEM, Some(length)) => {
                let value = bytes
                    .get(item.value_at..)
                    .and_then(|rest| rest.get(..length));
                items.push((at, value.ok_or(Fault::Short)?));
                at = item.value_at + length;
            }
            _ => return Err(Fault::Damaged(at)),
        }
    }
}

fn join(fragments: &[(usize, &[u8])]) -> Vec<u8> {
    let parts = fragments.iter().map(|(_, bytes)| *bytes);
    parts.collect::<Vec<_>>().concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encapsulated(table: &[u32], fragments: &[&[u8]]) -> Vec<u8> {
        let table = table
            .iter()
            .flat_map(|n| n.to_le_bytes())
            .collect::<Vec<_>>();
        let all = [&table[..]].into_iter().chain(fragments.iter().copied());
        let items = all.map(|bytes| {
            let length = (bytes.len() as u32).to_le_bytes();
            [b"\xfe\xff\x00\xe0", &length[..], bytes].concat()
        });
        [
            items.collect::<Vec<_>>().concat(),
            b"\xfe\xff\xdd\xe0\0\0\0\0".to_vec(),
        ]
        .concat()
    }

    #[test]
    fn frames_are_put_together_from_their_fragments() {
        let of = |bytes: &[u8], index, frames| {
            of_frame(bytes, index, frames)
                .unwrap()
                .map(|b| b.into_owned())
        };
        let one = encapsulated(&[], &[b"ab", b"cd", b"ef"]);
        assert_eq!(of(&one, 0, 1).unwrap(), b"abcdef");
        assert_eq!(of(&one, 1, 3).unwrap(), b"cd");
        assert_eq!(of(&one, 0, 2), None);
        // The second frame starts at the second fragment: 8 + 2 bytes after the first.
        let two = encapsulated(&[0, 10], &[b"ab", b"cd", b"ef"]);
        assert_eq!(of(&two, 0, 2).unwrap(), b"ab");
        assert_eq!(of(&two, 1, 2).unwrap(), b"cdef");
        for length in 0..two.len() {
            assert!(of_frame(&two[..length], 0, 2).is_err(), "{length}");
        }
    }
}
