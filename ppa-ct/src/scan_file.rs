//! Sequential reading of a scan file, with errors that name it.

use std::io::{self, BufRead, BufReader, Cursor, Read};
use std::mem;
use std::path::{Component, Path, PathBuf};

use flate2::bufread::{MultiGzDecoder, ZlibDecoder};
use nalgebra::Affine3;

use crate::acquisition::Acquisition;
use crate::error::ReadError;
use crate::grid::Grid;
use crate::scan::{Scan, Warning, WarningCode, hu_plausibility};
use crate::stored::Stored;
use crate::values::Voxels;
use crate::volume::Volume;
use crate::volume_error::VolumeError;

/// Largest number of bytes that one byte of a deflate stream can unpack to (zlib's technical notes: 1032:1).
const DEFLATE_MOST: u64 = 1032;

/// Longest line of a text header.
const LINE_BYTES: u64 = 1 << 16;

/// Packing of the remaining bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Packing {
    Raw,
    Gzip,
    Zlib,
}

/// Whether a file is a link to a place outside its folder.
fn leads_out(path: &Path) -> io::Result<bool> {
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    Ok(!path.canonicalize()?.starts_with(folder.canonicalize()?))
}

/// A file read from front to back.
pub(crate) struct ScanFile {
    path: PathBuf,
    stream: Box<dyn BufRead>,
    /// Remaining bytes; an upper bound if they are packed.
    most: u64,
    packed: bool,
}

impl ScanFile {
    pub(crate) fn open(path: &Path) -> Result<Self, ReadError> {
        let opened = || -> io::Result<_> {
            let file = ppa_core::regular_file::open(path)?;
            let most = file.metadata()?.len();
            Ok((file, most))
        };
        let (file, most) = opened().map_err(|source| ReadError::Io {
            path: path.to_owned(),
            source,
        })?;
        Ok(Self {
            path: path.to_owned(),
            stream: Box::new(BufReader::new(file)),
            most,
            packed: false,
        })
    }

    /// Opens the data file that a header names; it must be next to the header.
    pub(crate) fn open_beside(&self, name: &str) -> Result<Self, ReadError> {
        let name = name.strip_prefix("./").unwrap_or(name);
        let path = Path::new(name);
        let mut parts = path.components();
        let bare = matches!(
            (parts.next(), parts.next()),
            (Some(Component::Normal(part)), None) if part == path.as_os_str()
        );
        if !bare || name.contains('\\') {
            return Err(self.header(
                "the header points to voxels in another folder; expected a file next to the header",
            ));
        }
        let path = self.path.with_file_name(name);
        if leads_out(&path).map_err(|source| ReadError::Io {
            path: path.clone(),
            source,
        })? {
            return Err(self.header(
                "its voxel file is a link to another folder; expected a file next to the header",
            ));
        }
        Self::open(&path)
    }

    /// Error about the header.
    pub(crate) fn header(&self, problem: impl Into<String>) -> ReadError {
        ReadError::Header {
            path: self.path.clone(),
            problem: problem.into(),
        }
    }

    fn io(&self, source: io::Error) -> ReadError {
        ReadError::Io {
            path: self.path.clone(),
            source,
        }
    }

    fn unusable(&self, source: impl Into<VolumeError>) -> ReadError {
        ReadError::Volume {
            path: self.path.clone(),
            source: source.into(),
        }
    }

    /// Makes the lattice of a header.
    pub(crate) fn grid(&self, size: [usize; 3], affine: Affine3<f64>) -> Result<Grid, ReadError> {
        Grid::new(size, affine).map_err(|e| self.unusable(e))
    }

    /// Whether the next bytes are these; consumes nothing.
    pub(crate) fn next_is(&mut self, bytes: &[u8]) -> Result<bool, ReadError> {
        // The buffer may hold a single byte: the bytes are taken out and put back in front.
        let next = self.bytes(bytes.len())?;
        let found = next == bytes;
        self.most += next.len() as u64;
        let rest = mem::replace(&mut self.stream, Box::new(io::empty()));
        self.stream = Box::new(Cursor::new(next).chain(rest));
        Ok(found)
    }

    /// Reads up to `count` bytes, fewer if the file ends.
    pub(crate) fn bytes(&mut self, count: usize) -> Result<Vec<u8>, ReadError> {
        let mut bytes = Vec::new();
        (&mut self.stream)
            .take(count as u64)
            .read_to_end(&mut bytes)
            .map_err(|e| self.io(e))?;
        self.most = self.most.saturating_sub(bytes.len() as u64);
        Ok(bytes)
    }

    /// Reads the next line with its line feed, which is missing if the file ends before it.
    pub(crate) fn line(&mut self) -> Result<String, ReadError> {
        let mut line = Vec::new();
        (&mut self.stream)
            .take(LINE_BYTES)
            .read_until(b'\n', &mut line)
            .map_err(|e| self.io(e))?;
        self.most = self.most.saturating_sub(line.len() as u64);
        Ok(String::from_utf8_lossy(&line).into_owned())
    }

    /// Skips `count` bytes.
    pub(crate) fn skip(&mut self, count: u64) -> Result<(), ReadError> {
        io::copy(&mut (&mut self.stream).take(count), &mut io::sink()).map_err(|e| self.io(e))?;
        self.most = self.most.saturating_sub(count);
        Ok(())
    }

    /// Skips `count` bytes; returns whether any of them is not 0.
    pub(crate) fn skip_filled(&mut self, count: u64) -> Result<bool, ReadError> {
        let (mut left, mut filled) = (count, false);
        while left > 0 {
            let bytes = self.bytes(left.min(LINE_BYTES) as usize)?;
            if bytes.is_empty() {
                break;
            }
            filled |= bytes.iter().any(|byte| *byte != 0);
            left -= bytes.len() as u64;
        }
        Ok(filled)
    }

    /// Skips all but the last `count` bytes of a file that is not packed.
    pub(crate) fn skip_to_last(&mut self, count: u64) -> Result<(), ReadError> {
        self.skip(self.most.saturating_sub(count))
    }

    /// Unpacks the bytes from here on.
    pub(crate) fn unpacked(self, packing: Packing) -> Self {
        let unpacker: Box<dyn Read> = match packing {
            Packing::Raw => return self,
            Packing::Gzip => Box::new(MultiGzDecoder::new(self.stream)),
            Packing::Zlib => Box::new(ZlibDecoder::new(self.stream)),
        };
        Self {
            path: self.path,
            stream: Box::new(BufReader::new(unpacker)),
            most: self.most.saturating_mul(DEFLATE_MOST),
            packed: true,
        }
    }

    /// Reads the voxels, which fill the file from here to its end.
    ///
    /// Memory: two bytes per voxel, or four and briefly six if they do not all fit in 16 bits, reserved only if the
    /// file can contain them all. So one byte of a file costs at most six, or 6 x 1032 if it is deflated.
    pub(crate) fn voxels(mut self, stored: &Stored, size: [usize; 3]) -> Result<Voxels, ReadError> {
        let expected = stored.bytes_of(size).unwrap_or(u64::MAX);
        let wrong = |path: &Path, found| ReadError::PixelCount {
            path: path.to_owned(),
            found,
            expected,
        };
        if self.most < expected {
            return Err(if self.packed {
                self.header(format!(
                    "{expected} bytes of voxels, more than this file can decompress to"
                ))
            } else {
                wrong(&self.path, self.most)
            });
        }
        let width = stored.number.bytes() as u64;
        let voxels = (expected / width) as usize;
        let hu = stored
            .read(&mut self.stream, voxels)
            .map_err(|e| self.io(e))?;
        // Read to the very end, where checksums are compared.
        let surplus = io::copy(&mut self.stream, &mut io::sink()).map_err(|e| self.io(e))?;
        let found = hu.values().len();
        if found != voxels || surplus > 0 {
            return Err(wrong(&self.path, found as u64 * width + surplus));
        }
        Ok(hu)
    }
}

/// Makes a scan of the file `path` from its header and voxels.
pub(crate) fn scan(
    path: &Path,
    grid: Grid,
    hu: Voxels,
    modality: Option<String>,
    acquisition: Acquisition,
    warnings: impl IntoIterator<Item = Warning>,
) -> Result<Scan, ReadError> {
    let volume = Volume::of_voxels(grid, hu).map_err(|source| ReadError::Volume {
        path: path.to_owned(),
        source,
    })?;
    let plausible = hu_plausibility(&volume);
    Ok(Scan {
        warnings: warnings.into_iter().chain(plausible).collect(),
        volume,
        modality,
        series: Vec::new(),
        acquisition,
    })
}

/// Warning for a header that does not state the position of its voxels.
pub(crate) fn no_orientation(text: &str) -> Warning {
    Warning {
        code: WarningCode::NoOrientation,
        text: text.to_owned(),
    }
}
