//! Damaged files for testing the parsers.

use std::io::Write;
use std::path::Path;

use proptest::prelude::*;

/// One change to a text file.
#[derive(Debug, Clone)]
pub(crate) enum Damage {
    /// Keeps a share of the bytes.
    Truncate(f64),
    /// Flips one bit.
    Flip(f64, u8),
    /// Replaces a word by another.
    Word(f64, &'static str),
    /// Swaps two lines.
    Swap(f64, f64),
    /// Removes a line.
    Drop(f64),
    /// Repeats a line.
    Double(f64),
}

/// Up to five changes.
pub(crate) fn damage() -> impl Strategy<Value = Vec<Damage>> {
    let words = proptest::sample::select(&[
        "NaN",
        "inf",
        "1e30",
        "-1",
        "0",
        "99999999999",
        "1e-30",
        "x",
        "-0",
        "1e400",
        "",
        "#",
        "18446744073709551616",
        "65535",
        "4294967295",
    ] as &[_]);
    let at = || 0.0..1.0_f64;
    let one = prop_oneof![
        at().prop_map(Damage::Truncate),
        (at(), 0..8_u8).prop_map(|(at, bit)| Damage::Flip(at, bit)),
        (at(), words).prop_map(|(at, word)| Damage::Word(at, word)),
        (at(), at()).prop_map(|(a, b)| Damage::Swap(a, b)),
        at().prop_map(Damage::Drop),
        at().prop_map(Damage::Double),
    ];
    proptest::collection::vec(one, 0..6)
}

/// Applies the changes to `text`, one after the other.
pub(crate) fn damaged(text: &[u8], damage: &[Damage]) -> Vec<u8> {
    let mut bytes = text.to_vec();
    for injury in damage {
        let place = |share: f64, length: usize| (share * length as f64) as usize;
        let mut lines: Vec<Vec<u8>> = bytes.split(|&b| b == b'\n').map(<[u8]>::to_vec).collect();
        let count = lines.len();
        match *injury {
            Damage::Truncate(share) => {
                bytes.truncate(place(share, bytes.len()));
                continue;
            }
            Damage::Flip(share, bit) => {
                let at = place(share, bytes.len());
                if let Some(byte) = bytes.get_mut(at) {
                    *byte ^= 1 << bit;
                }
                continue;
            }
            Damage::Word(share, word) => {
                let text = String::from_utf8_lossy(&bytes).into_owned();
                let parts: Vec<&str> = text.split_inclusive(char::is_whitespace).collect();
                let at = place(share, parts.len());
                let mended = parts.iter().enumerate().map(|(index, part)| {
                    let blank = &part[part.trim_end().len()..];
                    if index == at {
                        format!("{word}{blank}")
                    } else {
                        (*part).into()
                    }
                });
                bytes = mended.collect::<String>().into_bytes();
                continue;
            }
            Damage::Swap(a, b) => lines.swap(place(a, count), place(b, count)),
            Damage::Drop(share) => {
                lines.remove(place(share, count));
            }
            Damage::Double(share) => {
                let line = lines[place(share, count)].clone();
                lines.insert(place(share, count), line);
            }
        }
        bytes = lines.join(&b'\n');
    }
    bytes
}

/// Returns the error of a reader for `sample` with one piece of it changed.
pub(crate) fn report<T: std::fmt::Debug, E: std::fmt::Display>(
    sample: &str,
    [from, to]: [&str; 2],
    reader: impl FnOnce(&Path) -> Result<T, E>,
) -> String {
    assert!(sample.contains(from), "{from}");
    let text = sample.replacen(from, to, 1);
    match read(text.as_bytes(), reader) {
        Ok(read) => panic!("{from} → {to} was read: {read:?}"),
        Err(error) => error.to_string(),
    }
}

/// Calls `reader` on a file with these bytes.
pub(crate) fn read<T>(bytes: &[u8], reader: impl FnOnce(&Path) -> T) -> T {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(bytes).unwrap();
    reader(file.path())
}
