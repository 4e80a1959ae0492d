//! Tally files.
//!
//! Layout, little-endian: the magic bytes, the format version (u32), the length of the header (u32), the header as JSON,
//! the sums of the image (u64: energy and squared energy per cell and category), then with doses the masses of the voxels
//! (f32) and the sums (u128 and u64), and the SHA-256 of all that.

use std::io::Read;
use std::ops::Range;
use std::path::Path;

use ppa_core::whole_file;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::run::analog_tally::{AnalogTally, RunSetup};
use crate::run::tally_error::TallyError;

const MAGIC: [u8; 8] = *b"ppaTally";
const FORMAT: u32 = 1;
const HASH_LEN: usize = 32;

/// Names and regions fit many times.
const LONGEST_HEADER: u64 = 1 << 24;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    part: Range<u64>,
    done: Range<u64>,
    run: RunSetup,
}

impl AnalogTally {
    /// Writes the tally; the file appears whole or not at all.
    ///
    /// # Errors
    /// [`TallyError::Write`].
    pub fn write(&self, path: &Path) -> Result<(), TallyError> {
        whole_file::write(path, &self.to_bytes()).map_err(|source| TallyError::Write {
            path: path.into(),
            source,
        })
    }

    /// Bytes that [`Self::write`] would write now; they hardly change while histories are counted.
    pub fn file_bytes(&self) -> u64 {
        self.to_bytes().len() as u64
    }

    fn to_bytes(&self) -> Vec<u8> {
        let header = Header {
            part: self.part.clone(),
            done: self.done.clone(),
            run: self.setup.clone(),
        };
        let header = serde_json::to_vec(&header).expect("all numbers of a setup are finite");
        let mut bytes = Vec::new();
        bytes.extend(MAGIC);
        bytes.extend(FORMAT.to_le_bytes());
        bytes.extend((header.len() as u32).to_le_bytes());
        bytes.extend(header);
        bytes.extend(self.image.to_bytes());
        if let (Some(setup), Some(dose)) = (&self.setup.dose, &self.dose) {
            bytes.extend(setup.voxel_g.iter().flat_map(|mass_g| mass_g.to_le_bytes()));
            bytes.extend(dose.to_bytes());
        }
        let hash = Sha256::digest(&bytes);
        bytes.extend(hash);
        bytes
    }

    /// Reads a tally.
    ///
    /// # Errors
    /// [`TallyError`] for a file that is not a tally, cut off or damaged.
    pub fn read(path: &Path) -> Result<Self, TallyError> {
        let failed = |source| TallyError::Read {
            path: path.into(),
            source,
        };
        let damaged = |what: &str| TallyError::Damaged {
            path: path.into(),
            what: what.to_owned(),
        };
        let foreign = || TallyError::Foreign { path: path.into() };
        let mut file = ppa_core::regular_file::open(path).map_err(failed)?;
        let found = file.metadata().map_err(failed)?.len();
        let mut start = [0; 16];
        // Whatever is too short for the first numbers is not a tally.
        file.read_exact(&mut start)
            .map_err(|source| match source.kind() {
                std::io::ErrorKind::UnexpectedEof => foreign(),
                _ => failed(source),
            })?;
        if start[..8] != MAGIC {
            return Err(foreign());
        }
        let word = |at: usize| u32::from_le_bytes(start[at..at + 4].try_into().expect("4 bytes"));
        if word(8) != FORMAT {
            return Err(TallyError::Format {
                path: path.into(),
                found: word(8),
                expected: FORMAT,
            });
        }
        let header_len = u64::from(word(12));
        if header_len > LONGEST_HEADER || 16 + header_len > found {
            return Err(TallyError::Size {
                path: path.into(),
                found,
                expected: 16 + header_len,
            });
        }
        let mut header = vec![0; header_len as usize];
        file.read_exact(&mut header).map_err(failed)?;
        let Header { part, done, run } =
            serde_json::from_slice(&header).map_err(|error| damaged(&error.to_string()))?;
        let expected = run
            .sums_len()
            .and_then(|sums| sums.checked_add(16 + header_len + HASH_LEN as u64))
            .ok_or_else(|| damaged("its header announces sums of a size that makes no sense"))?;
        if found != expected {
            return Err(TallyError::Size {
                path: path.into(),
                found,
                expected,
            });
        }
        let ordered = part.start <= part.end && part.end <= run.histories;
        if !(ordered && done.start == part.start && done.end >= done.start && done.end <= part.end)
        {
            return Err(damaged("its ranges of histories contradict each other"));
        }
        let mut rest = Vec::with_capacity((found - 16 - header_len) as usize);
        file.take(found).read_to_end(&mut rest).map_err(failed)?;
        let (sums, hash) = rest
            .split_last_chunk::<HASH_LEN>()
            .filter(|(sums, _)| sums.len() as u64 + 16 + header_len + HASH_LEN as u64 == found)
            .ok_or_else(|| damaged("it changed while it was read"))?;
        let digest = Sha256::new()
            .chain_update(start)
            .chain_update(&header)
            .chain_update(sums)
            .finalize();
        if digest[..] != hash[..] {
            return Err(damaged("its checksum does not fit"));
        }
        let mut tally = Self::empty(run, part);
        tally.done = done;
        let (image, rest) = sums.split_at(tally.image.byte_len());
        let mut fits = tally.image.add_bytes(image).is_some();
        if let (Some(setup), Some(dose)) = (&mut tally.setup.dose, &mut tally.dose) {
            let (masses, sums) = rest.split_at(4 * setup.voxel_count());
            setup.voxel_g = masses
                .chunks_exact(4)
                .map(|bytes| f32::from_le_bytes(bytes.try_into().expect("4 bytes")))
                .collect();
            fits &= dose.add_bytes(sums).is_some();
        }
        if !fits {
            return Err(damaged("its sums overflow"));
        }
        Ok(tally)
    }
}
