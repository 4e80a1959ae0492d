//! Penumbra of the collimator blades on the detector plane.

use nalgebra::{Point2, Point3};

use crate::beam::field::Field;
use crate::beam::source::FocalSpot;

/// The field of the beam as seen from every point of the focal spot.
///
/// Blades at the distance b from the spot are openings in a plane perpendicular to device z. On the detector plane, at the distance D,
/// the edges of the field move by D/b − 1 for every mm of the spot, in the opposite direction. The depth of a tilted spot is neglected:
/// it moves an edge by less than a tenth of the penumbra.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Blades {
    /// Field as seen from the middle of the spot.
    field: Field,
    /// D/b − 1; 0 for sharp edges.
    edge_per_spot: f64,
    /// Components of the axes of the spot's plane along device x and y.
    axes: [f64; 2],
}

impl Blades {
    /// Blades that leave `field` open on a plane `plane_mm` away; if `blades_mm` is `None`, they are in that plane. `axes`
    /// are the components along device x and y of those of the spot's plane.
    pub fn new(field: Field, plane_mm: f64, blades_mm: Option<f64>, axes: [f64; 2]) -> Self {
        Self {
            field,
            edge_per_spot: blades_mm.map_or(0.0, |blades_mm| plane_mm / blades_mm - 1.0),
            axes,
        }
    }

    /// The field reached by photons from a point of the spot.
    pub fn field_from(&self, spot: &Point3<f64>) -> Field {
        let shift = [0, 1].map(|axis| self.edge_per_spot * spot[axis]);
        Field {
            low_mm: [0, 1].map(|axis| self.field.low_mm[axis] - shift[axis]),
            high_mm: [0, 1].map(|axis| self.field.high_mm[axis] - shift[axis]),
        }
    }

    /// The field reached by photons from any point of the spot.
    pub fn reached(&self, spot: &FocalSpot) -> Field {
        self.grown(self.edge_per_spot * spot.reach_mm())
    }

    /// The field illuminated by the entire spot, except for the outermost 3e-3 of a Gaussian one; sides are negative if there is none.
    pub fn fully_lit(&self, spot: &FocalSpot) -> Field {
        self.grown(-self.edge_per_spot * spot.shadow_reach_mm())
    }

    /// Share of a cell of the spot that lights a point; `strips` are its strips along device x and y, of `count` equally
    /// strong ones along each axis.
    pub fn lit_share(
        &self,
        spot: &FocalSpot,
        strips: [usize; 2],
        count: usize,
        at: Point2<f64>,
    ) -> f64 {
        let lit = self.lit_part(spot, at);
        let along = |axis: usize| {
            let strip = strips[axis] as f64;
            let [first, last] =
                lit[axis].map(|share| (share * count as f64).clamp(strip, strip + 1.0));
            last - first
        };
        along(0) * along(1)
    }

    /// The part of the spot that lights a point: along device x and y, the shares of the spot below its first and its last point.
    pub fn lit_part(&self, spot: &FocalSpot, at: Point2<f64>) -> [[f64; 2]; 2] {
        if self.edge_per_spot == 0.0 || spot.is_point() {
            return [[0.0, f64::from(u8::from(self.field.contains(&at)))]; 2];
        }
        [0, 1].map(|axis| {
            // Spot positions s that light x: low − k s ≤ x ≤ high − k s.
            let per_mm = 1.0 / (self.edge_per_spot * self.axes[axis]);
            let edges_mm = [self.field.low_mm[axis], self.field.high_mm[axis]];
            edges_mm.map(|edge_mm| spot.share_below((edge_mm - at[axis]) * per_mm))
        })
    }

    /// The field enlarged by the same length on all sides.
    fn grown(&self, by_mm: f64) -> Field {
        let by = self.axes.map(|axis| by_mm * axis);
        Field {
            low_mm: [0, 1].map(|axis| self.field.low_mm[axis] - by[axis]),
            high_mm: [0, 1].map(|axis| self.field.high_mm[axis] + by[axis]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beam::source::SpotShape;

    fn blades(blades_mm: Option<f64>) -> Blades {
        Blades::new(
            Field::centred([0.0, 10.0], [100.0, 60.0]),
            1_000.0,
            blades_mm,
            [1.0; 2],
        )
    }

    /// A spot of 1.2 mm behind blades at 250 mm: 3.6 mm from dark to full, half at the edge; the strips add up.
    #[test]
    fn the_penumbra_is_as_wide_as_geometry_says() {
        let blades = blades(Some(250.0));
        for shape in [SpotShape::Uniform, SpotShape::Gaussian] {
            let spot = FocalSpot {
                size_mm: 1.2,
                shape,
            };
            let share =
                |x_mm: f64| blades.lit_share(&spot, [0; 2], 1, Point2::new(50.0 + x_mm, 12.0));
            assert!((share(0.0) - 0.5).abs() < 1e-6);
            assert!((share(-0.9) + share(0.9) - 1.0).abs() < 1e-6);
            if shape == SpotShape::Uniform {
                assert!((share(-0.9) - 0.75).abs() < 1e-9);
                assert_eq!((share(-1.81), share(1.81)), (1.0, 0.0));
            } else {
                // 3.6 mm are 2.3548 standard deviations; Φ(−1) = 0.158655.
                let sigma_mm = 3.6 / 2.354_820_045;
                assert!((share(sigma_mm) - 0.158_655).abs() < 1e-6);
            }
            let at = Point2::new(50.7, 40.4);
            let sum: f64 = (0..16)
                .map(|n| blades.lit_share(&spot, [n % 4, n / 4], 4, at) / 16.0)
                .sum();
            assert!((sum - blades.lit_share(&spot, [0; 2], 1, at)).abs() < 1e-12);
        }
    }

    #[test]
    fn without_a_distance_edges_are_sharp() {
        let blades = blades(None);
        let spot = FocalSpot {
            size_mm: 1.2,
            ..FocalSpot::default()
        };
        let field = blades.reached(&spot);
        assert_eq!(field, blades.fully_lit(&spot));
        assert_eq!(field, blades.field_from(&Point3::new(0.5, 0.5, 0.0)));
        for (x_mm, share) in [(49.99, 1.0), (50.01, 0.0)] {
            let at = Point2::new(x_mm, 0.0);
            assert_eq!(blades.lit_share(&spot, [0; 2], 1, at), share);
        }
    }
}
