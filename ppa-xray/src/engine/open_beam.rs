//! Energy that unattenuated photons of every line deposit in the detector, by position, in a table shared by all rays.
//!
//! Fluence, spectrum and response vary over centimetres (cos³θ, heel effect, incidence on converter and grid); linear interpolation
//! between nodes 2 mm apart is accurate to 1e-5.

use nalgebra::Point2;
use rayon::prelude::*;

use crate::beam::field::Field;

/// Largest distance of the nodes, mm.
const STEP_MM: f64 = 2.0;

/// Mean and mean square of the energy that photons of every line deposit, per cm² and history; padded to a multiple of
/// [`WIDTH`](crate::vector_math::WIDTH) lines.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct LineMoments {
    pub mean_kev: Vec<f32>,
    pub square_kev2: Vec<f32>,
}

/// [`LineMoments`] over a rectangle of the detector plane.
pub(crate) struct OpenBeam {
    low_mm: [f64; 2],
    per_mm: [f64; 2],
    /// Nodes along device x and y.
    size: [usize; 2],
    /// Row by row.
    nodes: Vec<LineMoments>,
}

impl OpenBeam {
    pub fn new(field: &Field, at: impl Fn(Point2<f64>) -> LineMoments + Sync) -> Self {
        let size_mm = field.size_mm();
        let intervals = size_mm.map(|mm| (mm / STEP_MM).ceil().max(1.0));
        let size = intervals.map(|count| count as usize + 1);
        let low_mm = field.low_mm;
        let place =
            |axis: usize, node: usize| low_mm[axis] + size_mm[axis] * node as f64 / intervals[axis];
        Self {
            low_mm,
            per_mm: [0, 1].map(|axis| intervals[axis] / size_mm[axis]),
            size,
            nodes: (0..size[0] * size[1])
                .into_par_iter()
                .map(|node| {
                    at(Point2::new(
                        place(0, node % size[0]),
                        place(1, node / size[0]),
                    ))
                })
                .collect(),
        }
    }

    /// Moments at a point of the rectangle.
    pub fn interpolate(&self, at: Point2<f64>, moments: &mut LineMoments) {
        let [(i, right), (j, up)] = [0, 1].map(|axis| {
            let at = (at[axis] - self.low_mm[axis]) * self.per_mm[axis];
            let node = (at.max(0.0) as usize).min(self.size[axis] - 2);
            (node, (at - node as f64) as f32)
        });
        let node = |i: usize, j: usize| &self.nodes[j * self.size[0] + i];
        let corners = [
            node(i, j),
            node(i + 1, j),
            node(i, j + 1),
            node(i + 1, j + 1),
        ];
        let weights = [
            (1.0 - right) * (1.0 - up),
            right * (1.0 - up),
            (1.0 - right) * up,
            right * up,
        ];
        mix(
            corners.map(|of| &of.mean_kev[..]),
            weights,
            &mut moments.mean_kev,
        );
        let squares = corners.map(|of| &of.square_kev2[..]);
        mix(squares, weights, &mut moments.square_kev2);
    }
}

fn mix([a, b, c, d]: [&[f32]; 4], weights: [f32; 4], mixed: &mut Vec<f32>) {
    mixed.clear();
    let pairs = a.iter().zip(b).zip(c.iter().zip(d));
    mixed.extend(pairs.map(|((a, b), (c, d))| {
        (a * weights[0] + b * weights[1]) + (c * weights[2] + d * weights[3])
    }));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector_math::WIDTH;

    /// cos³θ and a slope over half a metre at a distance of a metre, at the middle of a cell and next to the rim.
    #[test]
    fn slow_changes_are_interpolated_to_1e_5() {
        let field = Field::centred([10.0, -20.0], [500.0, 301.0]);
        let value = |at: Point2<f64>| {
            let square = (at.x * at.x + at.y * at.y) / 1e6;
            (1.0 + 1e-3 * at.x) * (1.0 + square).powf(-1.5)
        };
        let beam = OpenBeam::new(&field, |at| LineMoments {
            mean_kev: vec![value(at) as f32; WIDTH],
            square_kev2: vec![2.0 * value(at) as f32; WIDTH],
        });
        let mut moments = LineMoments::default();
        for at in [
            [11.0, 131.0],
            [-240.0, -170.5],
            [259.99, 130.49],
            [0.3, -0.7],
        ] {
            let at = Point2::from(at);
            beam.interpolate(at, &mut moments);
            assert_eq!(moments.mean_kev.len(), WIDTH);
            let ratio = f64::from(moments.mean_kev[3]) / value(at);
            let square = f64::from(moments.square_kev2[7]) / (2.0 * value(at));
            assert!(
                (ratio - 1.0).abs() < 1e-5 && (square - 1.0).abs() < 1e-5,
                "{at}: {ratio}"
            );
        }
    }
}
