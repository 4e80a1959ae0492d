//! Long runs of the analog engine: stopping rules, parts, tally files.

pub(crate) mod analog_run;
pub(crate) mod analog_tally;
pub(crate) mod framed_file;
pub(crate) mod key;
pub(crate) mod merge;
pub(crate) mod progress;
pub(crate) mod tally_error;
pub(crate) mod tally_file;
