//! Errors of a Time-of-Flight sensor, and their fit to a recording.

pub(crate) mod fit_noise;
pub(crate) mod local_plane;
pub(crate) mod modulation;
pub(crate) mod multipath;
pub(crate) mod observe;
pub(crate) mod random;
pub(crate) mod spec;
pub(crate) mod tremor;
