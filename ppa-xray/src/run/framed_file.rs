//! Frame format of files that hold the state of a run.
//!
//! Layout, little-endian: the magic bytes, the format version (u32), the length of the header (u32), the header as JSON,
//! the sums, and the SHA-256 of all that.

use std::fs::File;
use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};

use crate::run::tally_error::TallyError;

/// Magic bytes, format version and length of the header.
const START_LEN: usize = 16;

const HASH_LEN: usize = 32;

/// Upper limit; names and regions are much shorter.
const LONGEST_HEADER: u64 = 1 << 24;

/// A kind of file.
pub(crate) struct Frame {
    pub magic: [u8; 8],
    pub format: u32,
}

/// Writes to `out` and hashes the bytes.
pub(crate) struct Hashed<W> {
    out: W,
    hash: Sha256,
}

impl<W: Write> Write for Hashed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.hash.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

fn json(header: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(header).expect("all numbers of a header are finite")
}

/// A regular file opened for reading, and its length in bytes.
pub(crate) fn open(path: &Path) -> Result<(File, u64), TallyError> {
    let failed = |source| TallyError::Read {
        path: path.into(),
        source,
    };
    let file = ppa_core::regular_file::open(path).map_err(failed)?;
    let found = file.metadata().map_err(failed)?.len();
    Ok((file, found))
}

impl Frame {
    /// Writes a file; `sums` writes its sums.
    ///
    /// # Errors
    /// [`io::Error`] of `out` or of `sums`.
    ///
    /// # Panics
    /// If a number in the header is not finite.
    pub fn write<W: Write>(
        &self,
        out: W,
        header: &impl Serialize,
        sums: impl FnOnce(&mut Hashed<W>) -> io::Result<()>,
    ) -> io::Result<()> {
        let header = json(header);
        let mut hashed = Hashed {
            out,
            hash: Sha256::new(),
        };
        hashed.write_all(&self.magic)?;
        hashed.write_all(&self.format.to_le_bytes())?;
        hashed.write_all(&(header.len() as u32).to_le_bytes())?;
        hashed.write_all(&header)?;
        sums(&mut hashed)?;
        let Hashed { mut out, hash } = hashed;
        out.write_all(&hash.finalize())
    }

    /// Number of bytes that [`Self::write`] writes with sums of `sums_len` bytes.
    ///
    /// # Panics
    /// If a number in the header is not finite.
    pub fn file_len(&self, header: &impl Serialize, sums_len: u64) -> u64 {
        (START_LEN + json(header).len() + HASH_LEN) as u64 + sums_len
    }

    /// Reads the header and the sums of a file of `found` bytes. `sums_len` returns the bytes of sums that a header announces, or `None` if
    /// the header is invalid. Errors name `path`.
    pub fn read<H: DeserializeOwned>(
        &self,
        path: &Path,
        mut file: impl Read,
        found: u64,
        sums_len: impl FnOnce(&H) -> Option<u64>,
    ) -> Result<(H, Vec<u8>), TallyError> {
        let damaged = |what: &str| TallyError::Damaged {
            path: path.into(),
            what: what.to_owned(),
        };
        let (header, before_sums) = self.read_header(path, &mut file, found, sums_len)?;
        let mut sums = Vec::with_capacity(found as usize - before_sums.len());
        let failed = |source| TallyError::Read {
            path: path.into(),
            source,
        };
        file.take(found).read_to_end(&mut sums).map_err(failed)?;
        let hash = sums
            .len()
            .checked_sub(HASH_LEN)
            .map(|sums_len| sums.split_off(sums_len))
            .filter(|_| (before_sums.len() + sums.len() + HASH_LEN) as u64 == found)
            .ok_or_else(|| damaged("it changed while it was read"))?;
        let digest = Sha256::new()
            .chain_update(&before_sums)
            .chain_update(&sums)
            .finalize();
        if digest[..] != hash[..] {
            return Err(damaged("its checksum does not match"));
        }
        Ok((header, sums))
    }

    /// The same as [`Self::read`], without the sums: returns the header and the number of bytes read.
    pub fn read_header<H: DeserializeOwned>(
        &self,
        path: &Path,
        mut file: impl Read,
        found: u64,
        sums_len: impl FnOnce(&H) -> Option<u64>,
    ) -> Result<(H, Vec<u8>), TallyError> {
        let failed = |source| TallyError::Read {
            path: path.into(),
            source,
        };
        let damaged = |what: &str| TallyError::Damaged {
            path: path.into(),
            what: what.to_owned(),
        };
        let foreign = || TallyError::Foreign { path: path.into() };
        let size = |expected| TallyError::Size {
            path: path.into(),
            found,
            expected,
        };
        let mut bytes = vec![0; START_LEN];
        // A file too short for the first numbers is not a tally.
        file.read_exact(&mut bytes)
            .map_err(|source| match source.kind() {
                ErrorKind::UnexpectedEof => foreign(),
                _ => failed(source),
            })?;
        if bytes[..8] != self.magic {
            return Err(foreign());
        }
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("4 bytes"));
        if word(8) != self.format {
            return Err(TallyError::Format {
                path: path.into(),
                found: word(8),
                expected: self.format,
            });
        }
        let header_len = u64::from(word(12));
        let before_sums = START_LEN as u64 + header_len;
        if header_len > LONGEST_HEADER || before_sums > found {
            return Err(size(before_sums));
        }
        bytes.resize(before_sums as usize, 0);
        file.read_exact(&mut bytes[START_LEN..]).map_err(failed)?;
        let header = serde_json::from_slice(&bytes[START_LEN..])
            .map_err(|error| damaged(&error.to_string()))?;
        let expected = sums_len(&header)
            .and_then(|sums| sums.checked_add(before_sums + HASH_LEN as u64))
            .ok_or_else(|| damaged("its header specifies sums of an impossible size"))?;
        if found != expected {
            return Err(size(expected));
        }
        Ok((header, bytes))
    }
}
