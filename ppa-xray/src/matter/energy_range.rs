//! Energy ranges of the tables and of the transport.

/// Lowest photon energy of the tables in keV.
pub const MIN_ENERGY_KEV: f64 = 1.0;
/// Highest photon energy of the tables in keV.
pub const MAX_ENERGY_KEV: f64 = 150.0;

/// Photons below this energy are absorbed on the spot: 5 keV x-rays are absorbed within 0.25 mm of tissue.
pub(crate) const CUTOFF_KEV: f64 = 5.0;
