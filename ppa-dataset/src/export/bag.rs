//! BagIt (RFC 8493): a copy of a dataset with the hash of every file, a format that archives and journals accept.

use std::collections::HashMap;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use serde::Serialize;
use sha2::{Digest, Sha256};

use crate::files::{FileError, hex};
use crate::manifest::Manifest;
use crate::published::{Published, PublishedError};
use crate::stop::{Stopped, go_on};
use crate::whole_folder::write_whole_folder;

const MANIFEST: &str = "manifest-sha256.txt";
const DECLARATION: &str = "BagIt-Version: 1.0\nTag-File-Character-Encoding: UTF-8\n";

/// Size of a bag.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Bag {
    /// Files of the dataset.
    pub files: u64,
    /// Their bytes.
    pub bytes: u64,
}

/// Why a dataset cannot be bagged; nothing is left behind in that case.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BagError {
    /// A file of the dataset or the bag.
    #[error(transparent)]
    File(#[from] FileError),
    /// A folder that is not a dataset.
    #[error(transparent)]
    Published(#[from] PublishedError),
    /// `ppa generate` did not finish the dataset.
    #[error("{} is not finished: it has no manifest.jsonl; run ppa generate again", .0.display())]
    Unfinished(PathBuf),
    /// A link or device, whose contents are not part of the dataset.
    #[error("{} is neither a file nor a folder, and a bag can hold nothing else", .0.display())]
    Special(PathBuf),
    /// The bag was not finished because a stop was requested.
    #[error("the bag was not finished")]
    Stopped(#[from] Stopped),
    /// An image that is not the one in `manifest.jsonl`.
    #[error("{} is altered or missing: its hash is {found}, but manifest.jsonl has {expected}", path.display())]
    Altered {
        /// The image.
        path: PathBuf,
        /// Its hash.
        found: String,
        /// The hash in its row.
        expected: String,
    },
}

/// First bytes of tables of grades and keys of pictures. They are never published, because they name readers or reveal who graded what.
const NOT_TO_BE_BAGGED: [&[u8]; 2] = [b"image,reader,grade", b"name,image,sha256"];

/// Copies the dataset in `root`, of either published layout, into the bag `to`, completely or not at all. Leaves out hidden files and
/// folders, such as the records of `ppa generate`, and tables of readers' grades and keys under any name. Once `stop` is true, it
/// ends before the next file and leaves nothing behind.
///
/// # Errors
/// [`BagError`], for example for images that differ from `manifest.jsonl`, outdated labels, and links. `to` must not exist or must be
/// empty.
pub fn bag(root: &Path, to: &Path, stop: &AtomicBool) -> Result<Bag, BagError> {
    Published::read(root)?;
    let mut listed = listed(root)?;
    let mut files = Vec::new();
    list(root, "", &mut files)?;
    write_whole_folder(to, |bag| {
        let mut bytes = 0;
        let mut manifest = String::new();
        for name in &files {
            go_on(stop)?;
            let (size, hash) = copy(&root.join(name), &bag.join("data").join(name))?;
            if let Some(expected) = listed.remove(name)
                && hash != expected
            {
                return Err(altered(root, name, &hash, expected));
            }
            bytes += size;
            manifest += &format!("{hash}  data/{}\n", encoded(name));
        }
        if let Some((name, expected)) = listed.into_iter().min() {
            return Err(altered(root, &name, "none", expected));
        }
        let count = files.len() as u64;
        let agent = concat!("ppa ", env!("CARGO_PKG_VERSION"));
        let info = format!("Bag-Software-Agent: {agent}\nPayload-Oxum: {bytes}.{count}\n");
        let mut tags = String::new();
        for (name, text) in [
            ("bagit.txt", DECLARATION),
            ("bag-info.txt", &info),
            (MANIFEST, &manifest),
        ] {
            let path = bag.join(name);
            fs::write(&path, text).map_err(FileError::at("write", &path))?;
            tags += &format!("{}  {name}\n", hex(&Sha256::digest(text.as_bytes())));
        }
        let path = bag.join("tagmanifest-sha256.txt");
        fs::write(&path, tags).map_err(FileError::at("write", &path))?;
        Ok(Bag {
            files: count,
            bytes,
        })
    })
}

fn altered(root: &Path, name: &str, found: &str, expected: String) -> BagError {
    BagError::Altered {
        path: root.join(name),
        found: found.to_owned(),
        expected,
    }
}

/// Hashes of the images in `manifest.jsonl`; empty for a dataset of other authors.
fn listed(root: &Path) -> Result<HashMap<String, String>, BagError> {
    if !root.join(Manifest::FILE).exists() {
        return if root.join(".ppa").exists() {
            Err(BagError::Unfinished(root.to_owned()))
        } else {
            Ok(HashMap::new())
        };
    }
    let rows = Manifest::read(root)?.files.into_iter();
    Ok(rows.map(|row| (row.file, row.sha256)).collect())
}

/// Names of all files below a folder, as paths from the root, sorted within each folder.
fn list(root: &Path, below: &str, files: &mut Vec<String>) -> Result<(), BagError> {
    let folder = root.join(below);
    let entries = fs::read_dir(&folder).and_then(Iterator::collect::<io::Result<Vec<_>>>);
    let mut entries = entries.map_err(FileError::at("read", &folder))?;
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        let path = entry.path();
        let name = entry
            .file_name()
            .into_string()
            .map_err(|_| FileError::at("name", &path)(io::Error::other("its name is not UTF-8")))?;
        let name = if below.is_empty() {
            name
        } else {
            format!("{below}/{name}")
        };
        if entry.file_name().to_string_lossy().starts_with('.') {
            continue;
        }
        let kind = entry.file_type().map_err(FileError::at("read", &path))?;
        if kind.is_dir() {
            list(root, &name, files)?;
        } else if kind.is_file() {
            if !names_readers(&path).map_err(FileError::at("read", &path))? {
                files.push(name);
            }
        } else {
            return Err(BagError::Special(path));
        }
    }
    Ok(())
}

fn names_readers(path: &Path) -> io::Result<bool> {
    let mut start = Vec::new();
    ppa_core::regular_file::open(path)?
        .take(64)
        .read_to_end(&mut start)?;
    // Spreadsheets begin a file with a byte order mark.
    let start = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&start);
    Ok(NOT_TO_BE_BAGGED
        .iter()
        .any(|header| start.starts_with(header)))
}

/// Copies a file and returns its size and hash as they were read.
fn copy(from: &Path, to: &Path) -> Result<(u64, String), FileError> {
    let folder = to.parent().expect("payload lies in the folder data");
    fs::create_dir_all(folder).map_err(FileError::at("create folder", folder))?;
    let mut source = ppa_core::regular_file::open(from).map_err(FileError::at("read", from))?;
    let mut target = File::create(to).map_err(FileError::at("write", to))?;
    let (mut size, mut hasher, mut buffer) = (0, Sha256::new(), vec![0; 1 << 16]);
    loop {
        let read = source
            .read(&mut buffer)
            .map_err(FileError::at("read", from))?;
        if read == 0 {
            return Ok((size, hex(&hasher.finalize())));
        }
        size += read as u64;
        hasher.update(&buffer[..read]);
        target
            .write_all(&buffer[..read])
            .map_err(FileError::at("write", to))?;
    }
}

/// A path as written in manifests: percent signs and the characters that end a line are percent-encoded.
fn encoded(name: &str) -> String {
    name.replace('%', "%25")
        .replace('\r', "%0D")
        .replace('\n', "%0A")
}
