//! Converts positions and directions to flights in the box: slopes, the distance to the detector plane, the first wall.

#![expect(
    clippy::needless_range_loop,
    reason = "one index runs through all arrays of a photon"
)]

use crate::isa::Kernel;
use crate::transport::lanes::flights::{Box32, Each, Flights, LANES, each};
use crate::vector_math::{greatest, least};

/// Computes slopes and the distance to the detector plane from positions and directions.
pub(super) struct Aim<'a> {
    pub space: &'a Box32,
    pub flights: &'a mut Flights,
    pub count: usize,
}

impl Kernel for Aim<'_> {
    #[inline(always)]
    fn run(self) {
        aim(self.space, self.flights, self.count.min(LANES));
    }
}

#[inline(always)]
fn aim(space: &Box32, flights: &mut Flights, count: usize) {
    let row = space.device_z;
    let plane = space.source_detector_mm;
    for i in 0..count {
        let direction = each(&flights.direction, i);
        let [x, y, z] = each(&flights.position, i);
        for axis in 0..3 {
            let slope = space.cells(axis, direction);
            // A flight parallel to a wall still needs a finite reciprocal.
            let guarded = if slope.abs() < 1e-12 { 1e-12 } else { slope };
            flights.slope[axis][i] = guarded;
            flights.inverse[axis][i] = 1.0 / guarded;
        }
        let height = row[0] * x + row[1] * y + row[2] * z + row[3];
        let forward = direction[2];
        let distance_mm = (plane - height) / forward;
        flights.to_plane_mm[i] = if forward > 0.0 {
            greatest(distance_mm, 0.0)
        } else {
            f32::INFINITY
        };
    }
}

/// Converts positions from mm in the device frame to cells.
pub(super) struct Place<'a> {
    pub space: &'a Box32,
    pub flights: &'a mut Flights,
    pub count: usize,
}

impl Kernel for Place<'_> {
    #[inline(always)]
    fn run(self) {
        for i in 0..self.count.min(LANES) {
            let position = each(&self.flights.position, i);
            for axis in 0..3 {
                let corner = self.space.cell_from_device[axis][3];
                self.flights.position[axis][i] = self.space.cells(axis, position) + corner;
            }
        }
    }
}

/// Moves photons from the source to the box.
pub(super) struct Enter<'a> {
    pub space: &'a Box32,
    pub flights: &'a mut Flights,
    /// Whether the photon meets the box before the detector plane.
    pub meets: &'a mut Each<u32>,
    pub count: usize,
}

impl Kernel for Enter<'_> {
    #[inline(always)]
    fn run(self) {
        enter(self.space, self.flights, self.meets, self.count.min(LANES));
    }
}

#[inline(always)]
fn enter(space: &Box32, flights: &mut Flights, meets: &mut Each<u32>, count: usize) {
    let size = space.size;
    for i in 0..count {
        let (mut first, mut last) = (0.0_f32, flights.to_plane_mm[i]);
        for axis in 0..3 {
            let (at, inverse) = (flights.position[axis][i], flights.inverse[axis][i]);
            let (a, b) = (-at * inverse, (size[axis] - at) * inverse);
            first = greatest(first, least(a, b));
            last = least(last, greatest(a, b));
        }
        let met = first < last;
        let distance_mm = if met { first } else { 0.0 };
        for axis in 0..3 {
            let at = flights.position[axis][i] + flights.slope[axis][i] * distance_mm;
            // The largest number below the far wall is still in the box.
            let within = least(greatest(at, 0.0), size[axis] * (1.0 - 1.2e-7));
            flights.position[axis][i] = if met { within } else { at };
        }
        flights.to_plane_mm[i] -= distance_mm;
        meets[i] = u32::from(met);
    }
}
