//! Energy grid of the transport tables.

use crate::matter::energy_range::{MAX_ENERGY_KEV, MIN_ENERGY_KEV};
use crate::octaves::Octaves;

/// Bins per octave of energy, as a power of two; linear interpolation is then within 1e-4 of E⁻³ laws.
const ENERGY_BITS: u32 = 8;

/// Parts of a bin, as a power of two: cross sections between the nodes show whether linear interpolation is sufficient.
const PART_BITS: u32 = 2;

/// Parts of a bin.
pub(crate) const PARTS: usize = 1 << PART_BITS;

/// Bins of the tables.
pub(crate) fn energy_bins() -> Octaves {
    Octaves::covering(MIN_ENERGY_KEV, MAX_ENERGY_KEV, ENERGY_BITS)
}

/// Nodes of the tables with [`PARTS`] − 1 energies between neighbours, keV.
pub(crate) fn energy_nodes() -> impl Iterator<Item = f64> {
    energy_bins().refined(PART_BITS).nodes()
}
