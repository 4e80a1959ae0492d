//! A rectangle of the detector plane.

use nalgebra::Point2;
use serde::{Deserialize, Serialize};

/// Sides along device x and y.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Field {
    /// Lowest x and y, mm.
    pub low_mm: [f64; 2],
    /// Highest x and y, mm.
    pub high_mm: [f64; 2],
}

impl Field {
    pub fn centred(centre_mm: [f64; 2], size_mm: [f64; 2]) -> Self {
        Self {
            low_mm: [0, 1].map(|axis| centre_mm[axis] - 0.5 * size_mm[axis]),
            high_mm: [0, 1].map(|axis| centre_mm[axis] + 0.5 * size_mm[axis]),
        }
    }

    pub fn size_mm(&self) -> [f64; 2] {
        [0, 1].map(|axis| self.high_mm[axis] - self.low_mm[axis])
    }

    pub fn contains(&self, at: &Point2<f64>) -> bool {
        (0..2).all(|axis| (self.low_mm[axis]..=self.high_mm[axis]).contains(&at[axis]))
    }

    /// Intersection of the two rectangles; `None` if they do not overlap.
    pub fn overlap(&self, other: &Self) -> Option<Self> {
        let low_mm = [0, 1].map(|axis| self.low_mm[axis].max(other.low_mm[axis]));
        let high_mm = [0, 1].map(|axis| self.high_mm[axis].min(other.high_mm[axis]));
        (low_mm[0] < high_mm[0] && low_mm[1] < high_mm[1]).then_some(Self { low_mm, high_mm })
    }

    /// Solid angle seen from `height_mm` above the point (x, y) of the plane, sr.
    ///
    /// The rectangle is a signed sum of four with one corner under the eye, each atan(ab / (h √(a² + b² + h²))).
    pub fn solid_angle_sr(&self, under: Point2<f64>, height_mm: f64) -> f64 {
        let corner = |x: f64, y: f64| {
            let (a, b) = (x - under.x, y - under.y);
            (a * b / (height_mm * (a * a + b * b + height_mm * height_mm).sqrt())).atan()
        };
        let ([x0, y0], [x1, y1]) = (self.low_mm, self.high_mm);
        corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0)
    }
}
