//! `checksums.sha256`: the hashes of a dataset's lists, as `sha256sum --check` reads them.
//!
//! The lists cover the images; a last line covers the file itself.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Component, Path};

use sha2::{Digest, Sha256};

use crate::files::{FileError, hex, sha256_of_file};

/// What the last line begins with: a comment to `sha256sum`.
const OWN: &str = "# sha256 of the lines above: ";

/// Hash of each list by its path from the dataset's root.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Checksums(BTreeMap<String, String>);

/// What stands in a dataset.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum FoundChecksums {
    /// No file.
    Absent,
    /// A file whose last line fits.
    Whole(Checksums),
    /// A file that is not as it was written.
    Damaged,
}

impl Checksums {
    /// Its file in a dataset.
    pub const FILE: &str = "checksums.sha256";

    /// Reads the file of the dataset in `root`.
    pub fn look(root: &Path) -> Result<FoundChecksums, FileError> {
        let path = root.join(Self::FILE);
        match fs::read(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(FoundChecksums::Absent),
            Err(error) => Err(FileError::at("read", &path)(error)),
            Ok(bytes) => {
                let text = String::from_utf8(bytes).ok();
                let parsed = text.and_then(|text| Self::parse(&text));
                Ok(parsed.map_or(FoundChecksums::Damaged, FoundChecksums::Whole))
            }
        }
    }

    fn parse(text: &str) -> Option<Self> {
        let lines = &text[..text.find(OWN)?];
        (text == with_own_line(lines)).then_some(())?;
        let pair = |line: &str| {
            let (hash, file) = line.split_once("  ")?;
            let mut parts = Path::new(file).components();
            // A list of another dataset may come from anywhere; it names no file outside of its folder.
            let below = parts.all(|part| matches!(part, Component::Normal(_)));
            below.then(|| (file.to_owned(), hash.to_owned()))
        };
        lines.lines().map(pair).collect::<Option<_>>().map(Self)
    }

    /// The lists below `root` that are missing or have another hash.
    pub fn altered(&self, root: &Path) -> Vec<String> {
        let same = |(file, hash): &(&String, &String)| {
            sha256_of_file(&root.join(file)).is_ok_and(|found| found == **hash)
        };
        let altered = self.0.iter().filter(|entry| !same(entry));
        altered.map(|(file, _)| file.clone()).collect()
    }
}

#[cfg(feature = "generate")]
impl FoundChecksums {
    /// The recorded hash of a list.
    pub fn hash_of(&self, file: &str) -> Option<&str> {
        match self {
            Self::Whole(Checksums(hashes)) => hashes.get(file).map(String::as_str),
            _ => None,
        }
    }

    /// The lists that are covered, in the order of their paths.
    pub fn files(&self) -> impl Iterator<Item = &str> {
        let hashes = match self {
            Self::Whole(Checksums(hashes)) => Some(hashes),
            _ => None,
        };
        hashes.into_iter().flatten().map(|(file, _)| file.as_str())
    }
}

#[cfg(feature = "generate")]
impl Checksums {
    /// Of files given by path and text.
    pub fn of<'a>(files: impl Iterator<Item = (&'a str, &'a str)>) -> Self {
        let hash = |text: &str| hex(&Sha256::digest(text.as_bytes()));
        Self(
            files
                .map(|(file, text)| (file.to_owned(), hash(text)))
                .collect(),
        )
    }

    /// The file's text.
    pub fn to_text(&self) -> String {
        let line = |(file, hash)| format!("{hash}  {file}\n");
        with_own_line(&self.0.iter().map(line).collect::<String>())
    }
}

fn with_own_line(lines: &str) -> String {
    let own = hex(&Sha256::digest(lines.as_bytes()));
    format!("{lines}{OWN}{own}\n")
}

#[cfg(all(test, feature = "generate"))]
mod tests {
    use super::*;

    #[test]
    fn every_flipped_bit_is_damage() {
        let sums = Checksums::of([("dataset.json", "{}"), ("manifest.jsonl", "")].into_iter());
        let text = sums.to_text();
        assert_eq!(Checksums::parse(&text), Some(sums));
        let outside = Checksums::of([("../dataset.json", "{}")].into_iter());
        assert_eq!(Checksums::parse(&outside.to_text()), None);
        for bit in 0..8 * text.len() {
            let mut bytes = text.clone().into_bytes();
            bytes[bit / 8] ^= 1 << (bit % 8);
            let parsed = String::from_utf8(bytes)
                .ok()
                .and_then(|text| Checksums::parse(&text));
            assert_eq!(parsed, None, "bit {bit}");
        }
    }
}
