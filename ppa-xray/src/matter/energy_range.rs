//! Energies at which photons are followed.

/// Photons below this energy are absorbed on the spot: 5 keV x-rays die within 0.25 mm of tissue.
pub(crate) const CUTOFF_KEV: f64 = 5.0;

/// Highest energy the cross-section data covers.
pub(crate) const CEILING_KEV: f64 = 150.0;
