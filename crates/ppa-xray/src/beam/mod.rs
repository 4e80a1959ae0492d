//! What leaves the focal spot, and towards where.

pub(crate) mod projection;
pub(crate) mod spectrum;
pub(crate) mod spectrum_error;
pub(crate) mod spectrum_file;
pub(crate) mod tube;
