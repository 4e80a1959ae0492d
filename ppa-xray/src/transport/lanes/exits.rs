//! Photons that leave the box and reach the detector plane or escape.

use nalgebra::Vector3;

use crate::transport::lanes::flights::each;
use crate::transport::lanes::{Lanes, Photon};
use crate::transport::score::{Arrival, Score};

impl Lanes<'_, '_> {
    /// Ends the flight in `lane`, which has left the box or met the detector plane.
    pub(super) fn leave(&mut self, lane: usize, score: &mut impl Score) {
        let position = each(&self.flights.position, lane);
        let direction = each(&self.flights.direction, lane);
        self.exit(
            &self.photons[lane],
            position,
            direction,
            self.flights.to_plane_mm[lane],
            score,
        );
    }

    /// Moves a photon from the edge of the box to the detector plane, or lets it escape.
    #[inline(always)]
    pub(super) fn exit(
        &self,
        photon: &Photon,
        position: [f32; 3],
        direction: [f32; 3],
        to_plane_mm: f32,
        score: &mut impl Score,
    ) {
        let slot = usize::from(photon.slot);
        let energy_kev = f64::from(photon.energy_kev);
        if to_plane_mm.is_finite() {
            let distance_mm = f64::from(to_plane_mm);
            let direction = Vector3::from(direction.map(f64::from));
            let [x, y, z] = position.map(f64::from);
            let m = &self.mm_from_cell;
            let mm = |row: usize| m[(row, 0)] * x + m[(row, 1)] * y + m[(row, 2)] * z + m[(row, 3)];
            let arrival = Arrival {
                x_mm: mm(0) + direction.x * distance_mm,
                y_mm: mm(1) + direction.y * distance_mm,
                direction,
                energy_kev,
                category: photon.category,
            };
            score.arrive(slot, &arrival, &mut self.generator(photon));
        } else {
            score.escape(slot, energy_kev);
        }
        score.finish(slot);
    }
}
