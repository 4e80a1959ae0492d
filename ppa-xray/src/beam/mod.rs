//! The photons that leave the focal spot, and their directions.

pub(crate) mod blades;
pub(crate) mod detector;
pub(crate) mod emitter;
pub(crate) mod extrafocal;
pub(crate) mod field;
pub(crate) mod heel;
pub(crate) mod marker;
pub(crate) mod projection;
pub(crate) mod projection_error;
pub(crate) mod raster;
pub(crate) mod receptor;
pub(crate) mod source;
pub(crate) mod spectral_lines;
pub(crate) mod spectrum;
pub(crate) mod spectrum_error;
pub(crate) mod spectrum_file;
pub(crate) mod tube;
