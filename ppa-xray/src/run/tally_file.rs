//! Tally files.
//!
//! The frame of [`framed_file`](crate::run::framed_file) contains the sums of the image (u64: energy and squared energy per cell and
//! category), followed with doses by the masses of the voxels (f32) and the sums (u128 and u64).

use std::io::{self, Read, Write};
use std::ops::Range;
use std::path::Path;

use ppa_core::whole_file;
use serde::{Deserialize, Serialize};

use crate::run::analog_tally::{AnalogTally, RunSetup};
use crate::run::framed_file::{Frame, open};
use crate::run::tally_error::TallyError;

const FRAME: Frame = Frame {
    magic: *b"ppaTally",
    format: 1,
};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    part: Range<u64>,
    done: Range<u64>,
    run: RunSetup,
}

/// Histories of a tally file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TallyHistories {
    /// Histories that the tally covers when complete.
    pub part: Range<u64>,
    /// Histories counted, from the start of the part.
    pub done: Range<u64>,
    /// Number of histories of the whole run.
    pub of_run: u64,
}

impl Header {
    fn histories(&self, path: &Path) -> Result<TallyHistories, TallyError> {
        let Self { part, done, run } = self;
        let ordered = part.start <= part.end && part.end <= run.histories;
        if !(ordered && done.start == part.start && done.end >= done.start && done.end <= part.end)
        {
            return Err(TallyError::Damaged {
                path: path.into(),
                what: "its ranges of histories contradict each other".to_owned(),
            });
        }
        Ok(TallyHistories {
            part: part.clone(),
            done: done.clone(),
            of_run: run.histories,
        })
    }
}

impl AnalogTally {
    /// Writes the tally. The file is written completely or not at all.
    ///
    /// # Errors
    /// [`TallyError::Write`].
    pub fn write(&self, path: &Path) -> Result<(), TallyError> {
        whole_file::write_with(path, |file| self.write_to(file)).map_err(|source| {
            TallyError::Write {
                path: path.into(),
                source,
            }
        })
    }

    /// Writes the contents of the file.
    pub(crate) fn write_to(&self, out: &mut impl Write) -> io::Result<()> {
        FRAME.write(out, &self.header(), |out| {
            out.write_all(&self.image.to_bytes())?;
            if let (Some(setup), Some(dose)) = (&self.setup.dose, &self.dose) {
                let masses = setup.voxel_g.iter().flat_map(|mass_g| mass_g.to_le_bytes());
                out.write_all(&masses.collect::<Vec<_>>())?;
                out.write_all(&dose.to_bytes())?;
            }
            Ok(())
        })
    }

    /// Number of bytes that [`Self::write`] would write now; it hardly changes while histories are counted.
    pub fn file_bytes(&self) -> u64 {
        let sums_len = self.setup.sums_len().expect("the sums are in memory");
        FRAME.file_len(&self.header(), sums_len)
    }

    fn header(&self) -> Header {
        Header {
            part: self.part.clone(),
            done: self.done.clone(),
            run: self.setup.clone(),
        }
    }

    /// Reads a tally.
    ///
    /// # Errors
    /// [`TallyError`] for a file that is not a tally, is truncated or is damaged.
    pub fn read(path: &Path) -> Result<Self, TallyError> {
        let (file, found) = open(path)?;
        Self::read_from(path, file, found)
    }

    /// Reads the histories of a tally file. The sums are not read, so damage to them is not detected.
    ///
    /// # Errors
    /// [`TallyError`] for a file that is not a tally, or is truncated.
    pub fn read_histories(path: &Path) -> Result<TallyHistories, TallyError> {
        let (file, found) = open(path)?;
        let sums_len = |header: &Header| header.run.sums_len();
        let (header, _) = FRAME.read_header(path, file, found, sums_len)?;
        header.histories(path)
    }

    /// The same as [`Self::read`], from `found` bytes of the file `path`.
    pub(crate) fn read_from(path: &Path, file: impl Read, found: u64) -> Result<Self, TallyError> {
        let damaged = |what: &str| TallyError::Damaged {
            path: path.into(),
            what: what.to_owned(),
        };
        let sums_len = |header: &Header| header.run.sums_len();
        let (header, sums) = FRAME.read(path, file, found, sums_len)?;
        header.histories(path)?;
        let Header { part, done, run } = header;
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
