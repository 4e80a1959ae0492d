//! Tar archives of files: written in one go, or extended file by file.
//!
//! An archive that a program extends may end in the middle of a member when the program is killed, and a damaged disk may
//! destroy a header. [`Archive::scan`] therefore lists all members whose headers are valid and whose data are complete.
//! Format: ustar, IEEE Std 1003.1 ("pax Interchange Format", "ustar Interchange Format").

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use tar::{EntryType, Header};

use crate::files::FileError;

/// Bytes of a header; data are padded to a multiple of this.
const BLOCK: u64 = 512;

/// Blocks of zeros at the end of an archive.
const END_BLOCKS: u64 = 2;

/// A file in an archive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Member {
    /// Path as in the archive, without a leading `./`.
    pub name: String,
    /// Start of its data, bytes from the start of the archive.
    pub start: u64,
    /// Bytes of its data.
    pub size: u64,
}

impl Member {
    /// Start of the next member, bytes from the start of the archive.
    pub fn end(&self) -> u64 {
        self.start + self.size.next_multiple_of(BLOCK)
    }
}

/// Contents of an archive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Archive {
    path: PathBuf,
    /// Its files in archive order; a name may occur several times.
    pub members: Vec<Member>,
    /// Bytes of the file.
    pub length: u64,
    /// First block that belongs to no member and is not zero, bytes from the start of the archive.
    pub damage: Option<u64>,
    /// Whether the archive ends within a member.
    is_torn: bool,
}

impl Archive {
    /// Lists the members of the archive at `path`, skipping folders, links and extended headers.
    ///
    /// # Errors
    /// [`FileError`] when the file cannot be read. Any bytes are accepted: [`Archive::damage`] reports those that belong to no
    /// member.
    pub fn scan(path: &Path) -> Result<Self, FileError> {
        let scanned = ppa_core::regular_file::open(path).and_then(|mut file| scan(&mut file));
        let scanned = scanned.map_err(FileError::at("read", path))?;
        Ok(Self {
            path: path.to_owned(),
            ..scanned
        })
    }

    /// Whether the archive ends as [`ArchiveWriter::finish`] would end it after a last member that ends at `end`.
    pub fn ends_after(&self, end: u64) -> bool {
        self.length == end + END_BLOCKS * BLOCK
    }

    /// Whether the archive ends with blocks of zeros, as every completed archive does.
    pub fn is_closed(&self) -> bool {
        let end = self.members.last().map_or(0, Member::end);
        let is_followed = self.is_torn || self.damage.is_some_and(|at| at >= end);
        !is_followed && self.length >= end + END_BLOCKS * BLOCK
    }

    /// The file of the archive.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Reads a member.
    ///
    /// # Errors
    /// [`FileError`] when the archive cannot be read or the member is no longer in its place.
    pub fn read(&self, member: &Member) -> Result<Vec<u8>, FileError> {
        let read = || {
            let mut file = ppa_core::regular_file::open(&self.path)?;
            file.seek(SeekFrom::Start(member.start - BLOCK))?;
            let mut block = [0; BLOCK as usize];
            file.read_exact(&mut block)?;
            let mut bytes = Vec::new();
            file.take(member.size).read_to_end(&mut bytes)?;
            let is_there = header(&block) == Some((Some(member.name.clone()), member.size));
            match is_there && bytes.len() as u64 == member.size {
                true => Ok(bytes),
                false => Err(io::Error::other(format!(
                    "{} was moved within the archive by another process",
                    member.name
                ))),
            }
        };
        read().map_err(FileError::at("read", &self.path))
    }
}

/// Scans an archive; leaves its path empty.
fn scan(file: &mut File) -> io::Result<Archive> {
    let length = file.metadata()?.len();
    let mut members = Vec::new();
    let (mut damage, mut is_torn) = (None, false);
    let mut at = 0;
    while at + BLOCK <= length {
        file.seek(SeekFrom::Start(at))?;
        let mut block = [0; BLOCK as usize];
        file.read_exact(&mut block)?;
        let start = at + BLOCK;
        match header(&block) {
            Some((_, size)) if size > length - start => {
                is_torn = true;
                break;
            }
            Some((name, size)) => {
                let member = Member {
                    name: name.unwrap_or_default(),
                    start,
                    size,
                };
                at = member.end();
                if !member.name.is_empty() {
                    members.push(member);
                }
            }
            // Headers begin at multiples of a block, so the next valid one is found after a damaged one.
            None => {
                if block.iter().any(|byte| *byte != 0) {
                    damage = damage.or(Some(at));
                }
                at = start;
            }
        }
    }
    Ok(Archive {
        path: PathBuf::new(),
        members,
        length,
        damage,
        is_torn,
    })
}

/// Name of the file, if it is one, and size of the data that follow a header block; `None` if the block is not a header.
fn header(block: &[u8; BLOCK as usize]) -> Option<(Option<String>, u64)> {
    let header = Header::from_byte_slice(block);
    if !block[257..].starts_with(b"ustar") || header.cksum().ok()? != checksum(block) {
        return None;
    }
    let size = header.entry_size().ok()?;
    let is_file = matches!(
        header.entry_type(),
        EntryType::Regular | EntryType::Continuous
    );
    let name = String::from_utf8(header.path_bytes().into_owned()).ok();
    let name = name.filter(|_| is_file);
    Some((
        name.map(|name| name.trim_start_matches("./").to_owned()),
        size,
    ))
}

/// Sum of the bytes of a header, with spaces in place of the checksum.
fn checksum(block: &[u8; BLOCK as usize]) -> u32 {
    let sum = |bytes: &[u8]| bytes.iter().map(|&byte| u32::from(byte)).sum::<u32>();
    sum(&block[..148]) + 8 * u32::from(b' ') + sum(&block[156..])
}

/// Whether the dataset at this path is an archive: the name ends in `.tar`, and it is not a folder.
pub fn is_archive(root: &Path) -> bool {
    root.extension().is_some_and(|ending| ending == "tar") && !root.is_dir()
}

/// Returns an error for an archive where a dataset must be read from a folder.
pub(crate) fn require_folder(root: &Path) -> Result<(), FileError> {
    let extract = "it is an archive; extract it to a folder first, for example with tar -xf";
    match is_archive(root) && root.exists() {
        true => Err(FileError::at("read", root)(io::Error::other(extract))),
        false => Ok(()),
    }
}

/// Writes members one after the other; the same files give the same bytes.
#[derive(Debug)]
pub struct ArchiveWriter<W>(W);

impl<W: Write> ArchiveWriter<W> {
    /// Writes from the current position of `to`.
    pub fn new(to: W) -> Self {
        Self(to)
    }

    /// Adds a file.
    ///
    /// # Errors
    /// [`io::Error`] of the system, or for a name of more than 255 bytes.
    pub fn add(&mut self, name: &str, bytes: &[u8]) -> io::Result<()> {
        let mut header = Header::new_ustar();
        header.set_path(name)?;
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        header.set_mtime(0);
        header.set_cksum();
        let padding = (bytes.len() as u64).next_multiple_of(BLOCK) - bytes.len() as u64;
        self.0.write_all(header.as_bytes())?;
        self.0.write_all(bytes)?;
        self.0.write_all(&[0; BLOCK as usize][..padding as usize])
    }

    /// Ends the archive.
    ///
    /// # Errors
    /// [`io::Error`] of the system.
    pub fn finish(mut self) -> io::Result<W> {
        self.0.write_all(&[0; (END_BLOCKS * BLOCK) as usize])?;
        self.0.flush()?;
        Ok(self.0)
    }
}

/// Replaces everything after the first `end` bytes of a file with members and syncs it to disk. Returns where they end.
///
/// # Errors
/// [`io::Error`] of the system; the file is then cut off at `end`.
pub fn extend(file: &mut File, end: u64, members: &[(String, Vec<u8>)]) -> io::Result<u64> {
    let mut writer = ArchiveWriter::new(Vec::new());
    for (name, bytes) in members {
        writer.add(name, bytes)?;
    }
    let bytes = writer.0;
    let written = (|| {
        file.set_len(end)?;
        file.seek(SeekFrom::Start(end))?;
        file.write_all(&bytes)?;
        file.sync_data()
    })();
    if let Err(error) = written {
        // The first error counts.
        let _ = file.set_len(end);
        return Err(error);
    }
    Ok(end + bytes.len() as u64)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn files() -> Vec<(String, Vec<u8>)> {
        let file = |(name, size): (&str, usize)| (name.to_owned(), vec![7; size]);
        [("a/b.png", 700), ("empty", 0), ("c.json", 512)]
            .map(file)
            .to_vec()
    }

    fn archive(files: &[(String, Vec<u8>)]) -> Vec<u8> {
        let mut writer = ArchiveWriter::new(Vec::new());
        for (name, bytes) in files {
            writer.add(name, bytes).unwrap();
        }
        writer.finish().unwrap()
    }

    fn scanned(bytes: &[u8]) -> (Archive, tempfile::TempDir) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tar");
        fs::write(&path, bytes).unwrap();
        (Archive::scan(&path).unwrap(), folder)
    }

    fn names(archive: &Archive) -> Vec<&str> {
        let members = archive.members.iter();
        members.map(|member| member.name.as_str()).collect()
    }

    /// The crate `tar` as an independent reader.
    #[test]
    fn another_reader_finds_the_same_files() {
        let bytes = archive(&files());
        let mut other = tar::Archive::new(bytes.as_slice());
        let found = other.entries().unwrap().map(|entry| {
            let mut entry = entry.unwrap();
            let mut bytes = Vec::new();
            entry.read_to_end(&mut bytes).unwrap();
            (entry.path().unwrap().display().to_string(), bytes)
        });
        assert_eq!(found.collect::<Vec<_>>(), files());
        let (archive, _folder) = scanned(&bytes);
        assert_eq!(archive.damage, None);
        for (member, (name, bytes)) in archive.members.iter().zip(files()) {
            assert_eq!(
                (&member.name, archive.read(member).unwrap()),
                (&name, bytes)
            );
        }
    }

    #[test]
    fn an_archive_cut_anywhere_keeps_its_whole_members() {
        let bytes = archive(&files());
        let (whole, _folder) = scanned(&bytes);
        for length in 0..bytes.len() {
            let (cut, _folder) = scanned(&bytes[..length]);
            let kept = whole.members.iter();
            let kept = kept.filter(|member| member.start + member.size <= length as u64);
            assert!(cut.members.iter().eq(kept), "{length}");
            assert_eq!(cut.damage, None, "{length}");
        }
    }

    #[test]
    fn a_damaged_header_hides_only_its_own_member() {
        let bytes = archive(&files());
        let (whole, _folder) = scanned(&bytes);
        for (i, member) in whole.members.iter().enumerate() {
            for byte in [0, 124, 150, 257] {
                let mut bytes = bytes.clone();
                bytes[(member.start - BLOCK) as usize + byte] ^= 0x10;
                let (damaged, _folder) = scanned(&bytes);
                let mut others = names(&whole);
                others.remove(i);
                assert_eq!(names(&damaged), others, "byte {byte} of {}", member.name);
                assert_eq!(damaged.damage, Some(member.start - BLOCK));
            }
        }
    }

    #[test]
    fn members_are_added_in_place_of_a_torn_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tar");
        let mut file = fs::File::create_new(&path).unwrap();
        let end = extend(&mut file, 0, &files()[..1]).unwrap();
        extend(&mut file, end, &files()[2..]).unwrap();
        let after = extend(&mut file, end, &files()[1..2]).unwrap();
        assert_eq!(after, fs::metadata(&path).unwrap().len());
        assert_eq!(names(&Archive::scan(&path).unwrap()), ["a/b.png", "empty"]);
        assert!(extend(&mut file, after, &[("n".repeat(300), vec![])]).is_err());
        assert_eq!(fs::metadata(&path).unwrap().len(), after);
    }
}
