//! The primary image as the tolerance of the scatter estimate: its quantum noise at each point.
//!
//! docs/physics.md, "Fast engine", first collisions.

use nalgebra::{Point2, Point3};

use crate::beam::detector::Detector;
use crate::engine::node_grid::NodeGrid;
use crate::transport::tally::Moments;
use crate::transport::tracking::Transport;

/// Number of steps along the longer side of the detector at which tolerances are computed.
const TOLERANCES: f64 = 15.0;

/// Approximate scatter in the dark relative to the open field.
const LEAST_SCATTER: f64 = 0.01;

/// The primary image, for comparison with scatter.
pub(crate) struct PrimarySignal<'a> {
    pub detector: &'a Detector,
    pub moments: &'a [Moments],
    /// Energy of a pixel in the open field, keV per history.
    pub open_kev: f64,
}

impl PrimarySignal<'_> {
    /// Energy in the nearest pixel, keV per history.
    pub fn at(&self, at: Point2<f64>) -> f64 {
        let low = self.detector.field().low_mm;
        let count = [self.detector.columns, self.detector.rows];
        let [column, row] = [0, 1].map(|axis| {
            let pixel = (at[axis] - low[axis]) / self.detector.pixel_mm;
            (pixel.max(0.0) as usize).min(count[axis] as usize - 1)
        });
        self.moments[row * self.detector.columns as usize + column].mean_kev
    }

    /// Points of the detector plane, and the relative errors of scatter there that the noise of an exposure hides:
    /// the square roots of the signal.
    pub fn tolerances(&self, transport: &Transport) -> Vec<(Point3<f64>, f64)> {
        let [width, height] = self.detector.field().size_mm();
        let grid = NodeGrid::new(self.detector, width.max(height) / TOLERANCES);
        (0..grid.nodes())
            .map(|node| grid.place(node))
            .map(|at| {
                let target = Point3::new(at.x, at.y, transport.projection.source_detector_mm);
                (target, (self.relative_at(at) + LEAST_SCATTER).sqrt())
            })
            .collect()
    }

    pub fn relative_at(&self, at: Point2<f64>) -> f64 {
        self.at(at) / self.open_kev
    }
}
