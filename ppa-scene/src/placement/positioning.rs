//! Errors of positioning: a limb that is tilted, or whose joint is off the central beam.

use serde::{Deserialize, Serialize};

use crate::placement::error::PlaceError;

/// Largest tilt, degrees.
const MOST_TILT_DEG: f64 = 45.0;

/// Largest shift of the beam in one direction, mm.
const MOST_SHIFT_MM: f64 = 300.0;

/// Errors of positioning apart from the rotation.
///
/// The default is the paper's pose: the limb rests on two places, its joint on the central beam.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Positioning {
    /// Tilt from the pose in which the limb rests on two places, about the axis across the table through the joint, degrees: above 0 the
    /// proximal end is lifted, below 0 the distal end. The support of that end is not modelled.
    pub tilt_deg: f64,
    /// Offset of the central beam from the joint, mm: across the table, towards the left of a supine patient, and along it, towards the
    /// head; x and y of the built-in room. It is the same for right and left limbs.
    pub beam_shift_mm: [f64; 2],
}

impl Positioning {
    /// Checks that the values are in range.
    ///
    /// # Errors
    /// [`PlaceError::Positioning`] for a tilt beyond ±45 degrees or a shift beyond ±300 mm.
    pub fn check(&self) -> Result<(), PlaceError> {
        let [across_mm, along_mm] = self.beam_shift_mm;
        for (name, found, most, unit) in [
            ("tilt_deg", self.tilt_deg, MOST_TILT_DEG, "degrees"),
            ("beam_shift_mm", across_mm, MOST_SHIFT_MM, "mm"),
            ("beam_shift_mm", along_mm, MOST_SHIFT_MM, "mm"),
        ] {
            if !(-most..=most).contains(&found) {
                return Err(PlaceError::Positioning {
                    name,
                    found,
                    most,
                    unit,
                });
            }
        }
        Ok(())
    }

    /// Whether the limb rests with its joint on the central beam.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }
}
