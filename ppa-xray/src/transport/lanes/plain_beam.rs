//! Photons of a point source without heel effect.

use crate::isa::Kernel;
use crate::transport::lanes::draws::unit;
use crate::transport::lanes::flights::{Each, Flights, LANES};

/// Emits photons from the origin towards the field, uniformly in solid angle.
pub(super) struct PlainBeam<'a> {
    /// Lowest x and y of the field and its sides, mm.
    pub low_mm: [f32; 2],
    pub size_mm: [f32; 2],
    pub distance_mm: f32,
    /// Random words.
    pub words: &'a [Each<u32>; 4],
    pub flights: &'a mut Flights,
    /// Whether the photon is kept: points uniform over the field are kept with probability cos³θ.
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

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
    use crate::beam::field::Field;
    use crate::isa::Isa;
    use crate::transport::lanes::draws::{Draw, Draws};
    use crate::transport::stream::Stream;

    /// The number of kept photons, from points uniform over a wide field, is proportional to solid angle, for the field and for a quarter
    /// of it about the centre, with the axis off centre: 4.5 standard errors, 7e-6 each.
    #[test]
    fn photons_kept_are_even_in_solid_angle() {
        let field = Field::centred([100.0, 0.0], [1_000.0, 800.0]);
        let inner = Field::centred([100.0, 0.0], [500.0, 400.0]);
        let distance_mm = 400.0;
        let [width, height] = field.size_mm();
        let (mut draws, mut flights) = (Draws::new(Stream::History), Flights::new());
        let (mut kept, rounds) = ([0; LANES], 2_000_u32);
        let mut found = [0.0; 2];
        for round in 0..rounds {
            draws.counter[0] = std::array::from_fn(|i| round * LANES as u32 + i as u32);
            Isa::widest().run(Draw {
                key: [5, 0],
                draws: &mut draws,
                count: LANES,
            });
            Isa::widest().run(PlainBeam {
                low_mm: field.low_mm.map(|low| low as f32),
                size_mm: field.size_mm().map(|size| size as f32),
                distance_mm: distance_mm as f32,
                words: &draws.block,
                flights: &mut flights,
                kept: &mut kept,
                count: LANES,
            });
            for i in (0..LANES).filter(|&i| kept[i] != 0) {
                let [x, y, z] = [0, 1, 2].map(|axis| f64::from(flights.direction[axis][i]));
                let at = Point2::new(x, y) * (distance_mm / z);
                found[0] += 1.0;
                found[1] += f64::from(u8::from(inner.contains(&at)));
            }
        }
        let drawn = f64::from(rounds) * LANES as f64;
        for (found, part) in found.into_iter().zip([field, inner]) {
            let share = part.solid_angle_sr(Point2::origin(), distance_mm) * distance_mm.powi(2)
                / (width * height);
            let z = (found - drawn * share) / (drawn * share * (1.0 - share)).sqrt();
            assert!(
                z.abs() < 4.5,
                "{found} of {drawn}, expected {share}: {z:.1} sigma"
            );
        }
    }
}
