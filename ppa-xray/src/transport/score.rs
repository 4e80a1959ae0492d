//! Interface between histories and tallies.

use nalgebra::Vector3;
use ppa_core::random::Philox;

use crate::transport::tally::Category;

/// A photon at the detector plane, in the device frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Arrival {
    pub x_mm: f64,
    pub y_mm: f64,
    /// Unit vector; z is positive.
    pub direction: Vector3<f64>,
    pub energy_kev: f64,
    pub category: Category,
}

/// Receives the events of histories. Several histories may run at once, each in a slot of its own.
pub(crate) trait Score {
    /// A photon leaves the source in `slot`.
    fn emit(&mut self, _slot: usize, _energy_kev: f64) {}

    /// The history in `slot` deposits energy in a voxel of the phantom.
    fn deposit(&mut self, _slot: usize, _voxel: usize, _energy_kev: f64) {}

    /// The photon in `slot` crosses the detector plane; `rng` is that of its history.
    fn arrive(&mut self, slot: usize, arrival: &Arrival, rng: &mut Philox);

    /// The photon in `slot` escapes without meeting the detector plane.
    fn escape(&mut self, _slot: usize, _energy_kev: f64) {}

    /// The history in `slot` has ended; the next one reuses the slot.
    fn finish(&mut self, _slot: usize) {}
}
