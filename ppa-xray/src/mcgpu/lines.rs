//! Lines of a text file, plain or gzip, one at a time.

use std::io::{Read, Seek};
use std::path::{Path, PathBuf};

use flate2::read::MultiGzDecoder;

use crate::mcgpu::error::McgpuError;

/// Number of bytes read at once.
const CHUNK: usize = 1 << 20;

/// Longest line that is accepted as text; MC-GPU itself stops at 250 bytes.
const LONGEST_LINE: usize = 4_096;

/// Reads a file line by line in constant memory. gzip is detected by its first two bytes, as in zlib, not by the name.
pub(crate) struct Lines {
    path: PathBuf,
    reader: Box<dyn Read>,
    buffer: Vec<u8>,
    /// The part of the buffer that has not been returned.
    pending: std::ops::Range<usize>,
    ended: bool,
    number: u64,
    bytes: u64,
    compressed: bool,
}

impl Lines {
    pub fn open(path: &Path) -> Result<Self, McgpuError> {
        let open = || -> std::io::Result<_> {
            let mut file = ppa_core::regular_file::open(path)?;
            let metadata = file.metadata()?;
            if metadata.is_dir() {
                return Err(std::io::ErrorKind::IsADirectory.into());
            }
            let mut magic = Vec::new();
            (&mut file).take(2).read_to_end(&mut magic)?;
            file.rewind()?;
            Ok((file, metadata.len(), magic == [0x1F, 0x8B]))
        };
        let (file, bytes, compressed) = open().map_err(|source| McgpuError::Read {
            path: path.into(),
            source,
        })?;
        let reader: Box<dyn Read> = if compressed {
            Box::new(MultiGzDecoder::new(file))
        } else {
            Box::new(file)
        };
        Ok(Self {
            path: path.into(),
            reader,
            buffer: vec![0; CHUNK + LONGEST_LINE],
            pending: 0..0,
            ended: false,
            number: 0,
            bytes,
            compressed,
        })
    }

    /// Returns the next line without its line feed; `None` at the end of the file.
    #[inline]
    pub fn next(&mut self) -> Result<Option<&[u8]>, McgpuError> {
        loop {
            let pending = &self.buffer[self.pending.clone()];
            if let Some(length) = pending.iter().position(|&byte| byte == b'\n') {
                let start = self.pending.start;
                self.pending.start += length + 1;
                self.number += 1;
                return Ok(Some(&self.buffer[start..start + length]));
            }
            if pending.len() > LONGEST_LINE {
                self.number += 1;
                let found = &self.buffer[self.pending.start..];
                return Err(self.unexpected(found, "lines of text of at most 4096 bytes"));
            }
            if self.ended {
                let rest = std::mem::replace(&mut self.pending, 0..0);
                if rest.is_empty() {
                    return Ok(None);
                }
                self.number += 1;
                return Ok(Some(&self.buffer[rest]));
            }
            self.refill()?;
        }
    }

    fn refill(&mut self) -> Result<(), McgpuError> {
        let kept = self.pending.len();
        self.buffer.copy_within(self.pending.clone(), 0);
        let room = &mut self.buffer[kept..];
        let read = loop {
            match self.reader.read(room) {
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                result => break result,
            }
        };
        let read = read.map_err(|source| McgpuError::Read {
            path: self.path.clone(),
            source,
        })?;
        self.pending = 0..kept + read;
        self.ended = read == 0;
        Ok(())
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Number of the last line read, from 1.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// Upper limit of the bytes of text in the file; the compression ratio of deflate is at most 1032.
    pub fn most_text_bytes(&self) -> u64 {
        self.bytes
            .saturating_mul(if self.compressed { 1_032 } else { 1 })
    }

    /// Length of the file on disk.
    pub fn file_bytes(&self) -> u64 {
        self.bytes
    }

    /// Returns the error for a line that contains `found`.
    pub fn unexpected(&self, found: &[u8], expected: impl Into<String>) -> McgpuError {
        let shown = &found[..found.len().min(60)];
        McgpuError::Line {
            path: self.path.clone(),
            line: self.number,
            found: String::from_utf8_lossy(shown).trim().to_owned(),
            expected: expected.into(),
        }
    }

    /// Returns the error for a file that ends here.
    pub fn ends(&self, expected: impl Into<String>) -> McgpuError {
        McgpuError::Ends {
            path: self.path.clone(),
            line: self.number,
            expected: expected.into(),
        }
    }
}

/// Columns of a line, separated by blanks.
#[inline]
pub(crate) fn columns(line: &[u8]) -> impl Iterator<Item = &str> {
    line.split(u8::is_ascii_whitespace)
        .filter(|column| !column.is_empty())
        // Bytes that are not text are not a number either; no number begins with this character.
        .map(|column| std::str::from_utf8(column).unwrap_or("\u{FFFD}"))
}

/// Parses the first `N` columns of a line as numbers.
pub(crate) fn numbers<const N: usize>(line: &[u8]) -> Option<[f64; N]> {
    let mut columns = columns(line);
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        *number = columns.next()?.parse().ok()?;
    }
    Some(numbers)
}

/// Whether `line` contains `text`.
pub(crate) fn holds(line: &[u8], text: &str) -> bool {
    line.windows(text.len()).any(|part| part == text.as_bytes())
}
