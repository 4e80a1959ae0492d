//! Photons of a point source without heel effect.

use crate::transport::lanes::draws::unit;
use crate::transport::lanes::flights::{Each, Flights, LANES};
use crate::transport::lanes::isa::Kernel;

/// Sends photons from the origin towards the field, evenly in solid angle.
pub(super) struct PlainBeam<'a> {
    /// Lowest x and y of the field and its sides, mm.
    pub low_mm: [f32; 2],
    pub size_mm: [f32; 2],
    pub distance_mm: f32,
    /// Random words.
    pub words: &'a [Each<u32>; 4],
    pub flights: &'a mut Flights,
    /// Whether the photon is kept: points even on the field are kept with probability cos³θ.
    pub kept: &'a mut Each<u32>,
    pub count: usize,
}

impl Kernel for PlainBeam<'_> {
    #[inline(always)]
    fn run(self) {
        let ([left, top], [width, height]) = (self.low_mm, self.size_mm);
        let z = self.distance_mm;
        for i in 0..self.count.min(LANES) {
            let x = left + width * unit(self.words[0][i]);
            let y = top + height * unit(self.words[1][i]);
            let inverse = 1.0 / (x * x + y * y + z * z).sqrt();
            let cos = z * inverse;
            self.flights.direction[0][i] = x * inverse;
            self.flights.direction[1][i] = y * inverse;
            self.flights.direction[2][i] = cos;
            self.flights.position[0][i] = 0.0;
            self.flights.position[1][i] = 0.0;
            self.flights.position[2][i] = 0.0;
            self.kept[i] = u32::from(unit(self.words[2][i]) < cos * cos * cos);
        }
    }
}
