//! Photons on their way through the phantom to the detector.

pub(crate) mod attenuation;
pub(crate) mod tally;
pub(crate) mod tracking;
