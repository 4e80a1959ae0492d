//! Position of the side marker.

use ppa_core::Side;
use ppa_xray::SideMarker;
use serde::{Deserialize, Serialize};

/// The lead letter L or R on the detector, for the side of each limb.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MarkerPlace {
    /// Middle of the R in the images of right limbs, device x and y in mm; the L of left limbs has the opposite x, so that it lies
    /// on the same side of the limb.
    pub centre_mm: [f64; 2],
    /// Height of the letter, mm.
    #[serde(default = "default_height_mm")]
    pub height_mm: f64,
}

fn default_height_mm() -> f64 {
    15.0
}

impl MarkerPlace {
    /// A letter of 15 mm.
    #[must_use]
    pub fn new(centre_mm: [f64; 2]) -> Self {
        Self {
            centre_mm,
            height_mm: default_height_mm(),
        }
    }

    /// The letter of a limb.
    pub fn of(&self, side: Side) -> SideMarker {
        let [x, y] = self.centre_mm;
        let x = match side {
            Side::Right => x,
            Side::Left => -x,
        };
        SideMarker::new(side, [x, y]).with_height_mm(self.height_mm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn left_limbs_have_the_l_on_the_other_side() {
        let place = MarkerPlace::new([-75.0, -95.0]);
        let right = SideMarker::new(Side::Right, [-75.0, -95.0]);
        let left = SideMarker::new(Side::Left, [75.0, -95.0]);
        assert_eq!(
            [Side::Right, Side::Left].map(|side| place.of(side)),
            [right, left]
        );
    }
}
