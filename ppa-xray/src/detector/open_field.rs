//! Reading of the pixels with nothing in the beam.

use nalgebra::{Point2, Point3};
use serde::{Deserialize, Serialize};

use crate::beam::field::Field;
use crate::detector::response::Response;
use crate::transport::tracking::Transport;

/// Nodes per side of the detector, if intensity or response vary over it.
const NODES: usize = 33;

/// Reading over the detector plane without phantom and with the collimator fully open, relative to that at the detector's centre.
///
/// A uniform beam on a detector that absorbs everything falls off as cos³θ. Heel effect, grid and incidence on the
/// converter vary slowly, so their ratio to cos³θ is interpolated between a few nodes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct OpenField {
    low_mm: [f64; 2],
    high_mm: [f64; 2],
    source_detector_mm: f64,
    /// Part of the plane that the collimator leaves open to the entire focal spot.
    field: Field,
    side: usize,
    /// Row by row over the detector's rectangle.
    ratio: Vec<f64>,
}

impl OpenField {
    /// Returns the shape, and the reading at the centre in eV/cm² per history.
    pub fn of(transport: &Transport, response: &Response) -> (Self, f64) {
        let emitter = &transport.emitter;
        let open_over_focal = transport.open_over_focal();
        let source_detector_mm = transport.projection.source_detector_mm;
        let lines = emitter.lines();
        let at_lines = response.at_lines(&lines.energy_kev);
        let reading = |at: Point2<f64>| {
            let direction = Point3::new(at.x, at.y, source_detector_mm)
                .coords
                .normalize();
            let photons = lines.mixed(emitter.mixture(&direction));
            let left = at_lines.moments(at.into(), &direction);
            let signal_kev: f64 = photons.zip(left).map(|(n, left)| n * left.mean_kev).sum();
            let focal_cm2 = emitter.open_fluence_cm2(&Point3::origin(), at);
            1e3 * signal_kev * focal_cm2 * open_over_focal
        };
        let detector = transport.projection.detector;
        let Field { low_mm, high_mm } = detector.field();
        let centre = Point2::from(detector.centre_mm);
        let central = reading(centre);
        let even = response.is_ideal() && emitter.spectra().len() == 1;
        let side = if even { 2 } else { NODES };
        let mut shape = Self {
            low_mm,
            high_mm,
            source_detector_mm,
            field: emitter.fully_lit(),
            side,
            ratio: vec![1.0; side * side],
        };
        for node in 0..side * side {
            let share = [node % side, node / side].map(|i| i as f64 / (side - 1) as f64);
            let at = [0, 1].map(|axis| low_mm[axis] + share[axis] * (high_mm[axis] - low_mm[axis]));
            let at = Point2::from(at);
            shape.ratio[node] = reading(at) / central * shape.cos3(centre) / shape.cos3(at);
        }
        (shape, central)
    }

    /// Relative reading at device (x, y) of the detector's rectangle.
    pub fn at(&self, at: Point2<f64>) -> f64 {
        let [(i, s), (j, t)] = [0, 1].map(|axis| {
            let share = (at[axis] - self.low_mm[axis]) / (self.high_mm[axis] - self.low_mm[axis]);
            let place = share.clamp(0.0, 1.0) * (self.side - 1) as f64;
            let node = (place as usize).min(self.side - 2);
            (node, place - node as f64)
        });
        let row = |j: usize| {
            let row = &self.ratio[j * self.side + i..][..2];
            row[0] + s * (row[1] - row[0])
        };
        let centre = [0, 1].map(|axis| 0.5 * (self.low_mm[axis] + self.high_mm[axis]));
        let ratio = row(j) + t * (row(j + 1) - row(j));
        ratio * self.cos3(at) / self.cos3(Point2::from(centre))
    }

    /// Whether the entire square of side `side_mm` around `at` is in the collimated field, apart from rounding.
    pub fn exposes(&self, at: Point2<f64>, side_mm: f64) -> bool {
        const ROUNDING_MM: f64 = 1e-6;
        let reach_mm = 0.5 * side_mm - ROUNDING_MM;
        (0..2).all(|axis| {
            self.field.low_mm[axis] <= at[axis] - reach_mm
                && at[axis] + reach_mm <= self.field.high_mm[axis]
        })
    }

    fn cos3(&self, at: Point2<f64>) -> f64 {
        let d = self.source_detector_mm;
        (d / (d * d + at.coords.norm_squared()).sqrt()).powi(3)
    }
}
