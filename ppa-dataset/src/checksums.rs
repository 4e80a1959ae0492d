//! `checksums.sha256` and `labels.sha256`: hashes of a dataset's lists and of files added to it later, in the format of
//! `sha256sum --check`.
//!
//! The lists cover the images; a last line covers the file itself.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

use sha2::{Digest, Sha256};

use crate::files::{FileError, hex, sha256_of_file, write_whole};

/// Beginning of the last line: a comment to `sha256sum`.
const OWN: &str = "# sha256 of the lines above: ";

/// Hash of each file by its path from the dataset's root.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Checksums(BTreeMap<String, String>);

/// State of a file of hashes in a dataset.
#[derive(Debug, PartialEq, Eq)]
pub enum FoundChecksums {
    /// No file.
    Absent,
    /// A file that matches the hash in its last line.
    Whole(Checksums),
    /// A file that was changed after it was written.
    Damaged,
}

impl Checksums {
    /// The hashes of a dataset's lists.
    pub const FILE: &str = "checksums.sha256";

    /// The hashes of labels, grades and splits, which commands add to a finished dataset.
    pub const OF_LABELS: &str = "labels.sha256";

    /// Reads `checksums.sha256` of the dataset in `root`.
    pub fn look(root: &Path) -> Result<FoundChecksums, FileError> {
        Self::look_at(root, Self::FILE)
    }

    /// Reads one of the two files of hashes of the dataset in `root`.
    pub fn look_at(root: &Path, file: &str) -> Result<FoundChecksums, FileError> {
        let path = root.join(file);
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
            // The file may come from an untrusted dataset: reject paths that leave its folder.
            let below = parts.all(|part| matches!(part, Component::Normal(_)));
            below.then(|| (file.to_owned(), hash.to_owned()))
        };
        lines.lines().map(pair).collect::<Option<_>>().map(Self)
    }

    /// Adds the hashes of newly written files below `root` to `labels.sha256`; those of other files stay.
    pub fn record_labels(root: &Path, files: &[PathBuf]) -> Result<(), FileError> {
        let path = root.join(Self::OF_LABELS);
        let mut sums = match Self::look_at(root, Self::OF_LABELS)? {
            FoundChecksums::Absent => Self::default(),
            FoundChecksums::Whole(sums) => sums,
            FoundChecksums::Damaged => {
                let damaged = "it is altered: its hash does not match the one in its last line; remove it to record hashes again";
                return Err(FileError::at("add hashes to", &path)(io::Error::other(
                    damaged,
                )));
            }
        };
        for file in files {
            let below = file.strip_prefix(root).map_err(io::Error::other);
            let below = below.map_err(FileError::at("record the hash of", file))?;
            let names: Vec<_> = below.iter().map(|part| part.to_string_lossy()).collect();
            sums.0.insert(names.join("/"), sha256_of_file(file)?);
        }
        write_whole(&path, sums.to_text().as_bytes())
    }

    /// The text of the file.
    pub fn to_text(&self) -> String {
        let line = |(file, hash)| format!("{hash}  {file}\n");
        with_own_line(&self.0.iter().map(line).collect::<String>())
    }

    /// Returns the files below `root` that are missing or have another hash.
    pub fn altered(&self, root: &Path) -> Vec<String> {
        let same = |(file, hash): &(&String, &String)| {
            sha256_of_file(&root.join(file)).is_ok_and(|found| found == **hash)
        };
        let altered = self.0.iter().filter(|entry| !same(entry));
        altered.map(|(file, _)| file.clone()).collect()
    }
}

impl FoundChecksums {
    /// The recorded hash of a list.
    pub fn hash_of(&self, file: &str) -> Option<&str> {
        match self {
            Self::Whole(Checksums(hashes)) => hashes.get(file).map(String::as_str),
            _ => None,
        }
    }

    /// The listed files, sorted by path.
    pub fn files(&self) -> impl Iterator<Item = &str> {
        let hashes = match self {
            Self::Whole(Checksums(hashes)) => Some(hashes),
            _ => None,
        };
        hashes.into_iter().flatten().map(|(file, _)| file.as_str())
    }
}

impl Checksums {
    /// Hashes files given by path and text.
    pub fn of<'a>(files: impl Iterator<Item = (&'a str, &'a str)>) -> Self {
        let hash = |text: &str| hex(&Sha256::digest(text.as_bytes()));
        Self(
            files
                .map(|(file, text)| (file.to_owned(), hash(text)))
                .collect(),
        )
    }
}

fn with_own_line(lines: &str) -> String {
    let own = hex(&Sha256::digest(lines.as_bytes()));
    format!("{lines}{OWN}{own}\n")
}

#[cfg(test)]
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
