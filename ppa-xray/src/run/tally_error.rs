//! Errors of tally files.

use std::ops::Range;
use std::path::PathBuf;

/// Why a tally cannot be read, written, continued or merged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TallyError {
    /// The file could not be read.
    #[error("cannot read the tally {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the file system.
        source: std::io::Error,
    },
    /// The file could not be written.
    #[error("cannot write the tally {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Error of the file system.
        source: std::io::Error,
    },
    /// The file does not begin like a tally.
    #[error("{} is not a tally of ppa-xray", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// The format version of the file is not supported.
    #[error("{} has tally format {found}, expected {expected}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// Version of the file.
        found: u32,
        /// Version of this program.
        expected: u32,
    },
    /// The file is shorter or longer than announced.
    #[error("{} is {found} bytes long, expected {expected}: it was truncated or appended to", path.display())]
    Size {
        /// The file.
        path: PathBuf,
        /// Bytes of the file.
        found: u64,
        /// Bytes that its header announces.
        expected: u64,
    },
    /// The bytes of the file were changed.
    #[error("{} is damaged: {what}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is inconsistent.
        what: String,
    },
    /// Phantom, spectrum, exposure, models, seed or code differ.
    #[error(
        "{} belongs to another simulation: phantom, spectrum, exposure, models, doses, seed or version differ (key {found}, expected {expected})",
        path.display()
    )]
    Key {
        /// The file.
        path: PathBuf,
        /// Key of the file.
        found: String,
        /// Key of the simulation, or of the first file.
        expected: String,
    },
    /// The numbers of histories of the whole run differ.
    #[error("{} belongs to a run of {found} histories, expected {expected}", path.display())]
    Histories {
        /// The file.
        path: PathBuf,
        /// Histories of the run that the file is part of.
        found: u64,
        /// Histories of the run, or of the first file.
        expected: u64,
    },
    /// A part is not finished.
    #[error(
        "{} holds the histories {} to {} of its part, {} to {}: resume it first",
        path.display(), done.start, done.end, part.start, part.end
    )]
    Unfinished {
        /// The file.
        path: PathBuf,
        /// Histories counted.
        done: Range<u64>,
        /// Histories of the part.
        part: Range<u64>,
    },
    /// The file holds another part than the requested one.
    #[error(
        "{} is for the histories {} to {} of its run, expected {} to {}",
        path.display(), found.start, found.end, expected.start, expected.end
    )]
    Part {
        /// The file.
        path: PathBuf,
        /// Histories of the part in the file.
        found: Range<u64>,
        /// Histories of the requested part.
        expected: Range<u64>,
    },
    /// Two parts hold the same histories.
    #[error(
        "{} (histories {} to {}) and {} (histories {} to {}) overlap",
        first_path.display(), first.start, first.end,
        second_path.display(), second.start, second.end
    )]
    Overlap {
        /// The part that begins first.
        first_path: PathBuf,
        /// Histories of the first part.
        first: Range<u64>,
        /// The other part.
        second_path: PathBuf,
        /// Histories of the second part.
        second: Range<u64>,
    },
    /// Histories are missing.
    #[error("the histories {} to {} of {histories} are in none of the tallies", missing.start, missing.end)]
    Hole {
        /// Histories that no part holds.
        missing: Range<u64>,
        /// Histories of the whole run.
        histories: u64,
    },
    /// There is nothing to merge.
    #[error("no tally to merge")]
    Nothing,
}
