//! Long runs of the analog engine: stopping rules, parts, tally files.

pub(crate) mod analog_run;
pub(crate) mod analog_tally;
#[cfg(feature = "files")]
pub(crate) mod framed_file;
pub(crate) mod key;
#[cfg(feature = "files")]
pub(crate) mod merge;
pub(crate) mod progress;
#[cfg(feature = "files")]
pub(crate) mod tally_error;
#[cfg(feature = "files")]
pub(crate) mod tally_file;
