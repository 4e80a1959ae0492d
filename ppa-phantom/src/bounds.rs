//! Bounding boxes, by which distant shapes are skipped.

use nalgebra::{Point3, Vector3};

/// An axis-aligned box in limb coordinates, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bounds {
    pub low: Point3<f64>,
    pub high: Point3<f64>,
}

impl Bounds {
    /// The box of a ball.
    pub(super) fn ball(centre: &Point3<f64>, radius: f64) -> Self {
        let reach = Vector3::repeat(radius);
        Self {
            low: centre - reach,
            high: centre + reach,
        }
    }

    pub(super) fn everything() -> Self {
        Self {
            low: Point3::from(Vector3::repeat(f64::NEG_INFINITY)),
            high: Point3::from(Vector3::repeat(f64::INFINITY)),
        }
    }

    pub(super) fn join(&self, other: &Self) -> Self {
        Self {
            low: self.low.inf(&other.low),
            high: self.high.sup(&other.high),
        }
    }

    pub(super) fn meet(&self, other: &Self) -> Self {
        Self {
            low: self.low.sup(&other.low),
            high: self.high.inf(&other.high),
        }
    }

    pub(super) fn grown(&self, margin: f64) -> Self {
        let reach = Vector3::repeat(margin);
        Self {
            low: self.low - reach,
            high: self.high + reach,
        }
    }

    /// Distance from `p` to the box, 0 inside.
    pub(super) fn distance(&self, p: &Point3<f64>) -> f64 {
        let mut sum = 0.0;
        for axis in 0..3 {
            let out = (self.low[axis] - p[axis])
                .max(p[axis] - self.high[axis])
                .max(0.0);
            sum += out * out;
        }
        sum.sqrt()
    }
}
