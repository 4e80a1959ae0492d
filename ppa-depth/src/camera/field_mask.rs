//! Directions in which a camera measures depth.

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

/// Outline of the illuminated field, symmetric about the optical axis. Angles are full openings in degrees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum FieldMask {
    /// Corners on the horizontal axis; the edges at top and bottom are half as long as the full width.
    Hexagon {
        /// Opening angle from corner to corner.
        width_deg: f64,
        /// Opening angle from edge to edge.
        height_deg: f64,
    },
    /// A cone around the axis.
    Circle {
        /// Opening angle of the cone.
        diameter_deg: f64,
    },
}

impl FieldMask {
    /// Whether light returns from the direction (X/Z, Y/Z).
    pub fn contains(&self, slopes: &Vector2<f64>) -> bool {
        let half = |deg: f64| (0.5 * deg).to_radians().tan();
        match *self {
            Self::Hexagon {
                width_deg,
                height_deg,
            } => {
                let (x, y) = (
                    slopes.x.abs() / half(width_deg),
                    slopes.y.abs() / half(height_deg),
                );
                // The slanted edge runs from (1, 0) to (1/2, 1).
                y <= 1.0 && x + 0.5 * y <= 1.0
            }
            Self::Circle { diameter_deg } => slopes.norm() <= half(diameter_deg),
        }
    }

    /// The first angle that is not between 0 and 180 degrees.
    pub(crate) fn bad_angle(&self) -> Option<(&'static str, f64)> {
        let angles = match *self {
            Self::Hexagon {
                width_deg,
                height_deg,
            } => vec![("width_deg", width_deg), ("height_deg", height_deg)],
            Self::Circle { diameter_deg } => vec![("diameter_deg", diameter_deg)],
        };
        angles
            .into_iter()
            .find(|(_, deg)| !(0.0 < *deg && *deg < 180.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DepthMode;

    #[test]
    fn a_hexagon_has_corners_left_and_right() {
        let inside = |mask: &FieldMask, x_deg: f64, y_deg: f64| {
            mask.contains(&Vector2::new(
                x_deg.to_radians().tan(),
                y_deg.to_radians().tan(),
            ))
        };
        let hexagon = DepthMode::NfovUnbinned.mask();
        assert!(inside(&hexagon, 37.4, 0.0) && !inside(&hexagon, -37.6, 0.0));
        assert!(inside(&hexagon, 0.0, -32.4) && !inside(&hexagon, 0.0, 32.6));
        // tan 21° is half of tan 37.5°: the corner of the upper edge.
        assert!(inside(&hexagon, 20.9, 32.4) && !inside(&hexagon, 21.1, 32.4));
        let circle = DepthMode::WfovBinned.mask();
        assert!(inside(&circle, 59.9, 0.0) && !inside(&circle, 0.0, 60.1));
        assert!(!inside(&circle, 55.0, 55.0));
    }
}
