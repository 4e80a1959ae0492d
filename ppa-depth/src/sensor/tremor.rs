//! Small motion between the frames of a recording.

use nalgebra::{Isometry3, Point3, Translation3, Vector3};
use serde::{Deserialize, Serialize};

use crate::sensor::random::{Purpose, normals};
use crate::sensor::spec::SensorError;

/// Residual motion of a limb held still: normally distributed translations and rotations about a point, correlated in time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tremor {
    /// Standard deviation of the shift along each axis, mm.
    pub shift_mm: f64,
    /// Standard deviation of the rotation about each axis, degrees.
    pub turn_deg: f64,
    /// Frames after which the correlation has fallen to e⁻¹.
    pub correlation_frames: f64,
}

/// Longest memory of a tremor, frames: five minutes at 30 frames per second.
const LONGEST_FRAMES: f64 = 1e4;

impl Tremor {
    /// Checks that the numbers are in range.
    ///
    /// # Errors
    /// [`SensorError`] names the first that is not.
    pub fn check(&self) -> Result<(), SensorError> {
        for (name, found, most, expected) in [
            ("tremor.shift_mm", self.shift_mm, 1e6, "0 to 1e6 mm"),
            ("tremor.turn_deg", self.turn_deg, 360.0, "0 to 360 degrees"),
            (
                "tremor.correlation_frames",
                self.correlation_frames,
                LONGEST_FRAMES,
                "0 to 10000 frames",
            ),
        ] {
            if !(0.0..=most).contains(&found) {
                return Err(SensorError::Parameter {
                    name,
                    found,
                    expected,
                });
            }
        }
        Ok(())
    }

    /// Motion in one frame, about `pivot` and in its frame; independent of the frames requested before. The numbers must pass
    /// [`check`](Self::check).
    ///
    /// Independent normal numbers of all frames are weighted with a Gaussian around this one, whose squares sum to 1. Two
    /// frames k apart then correlate as exp(−k² / τ²), τ the correlation length.
    pub fn motion(&self, pivot: &Point3<f64>, seed: u64, frame: u64) -> Isometry3<f64> {
        let spread = self.correlation_frames.max(0.0) / 2.0;
        // exp(−(k/s)² / 2) correlates with itself as exp(−(k/s)² / 4): s = τ/2.
        let reach = (4.0 * spread).ceil().min(2.0 * LONGEST_FRAMES) as i64;
        let (mut shift, mut turn, mut squares) = (Vector3::zeros(), Vector3::zeros(), 0.0);
        for k in -reach..=reach {
            let weight = if spread > 0.0 {
                (-0.5 * (k as f64 / spread).powi(2)).exp()
            } else {
                1.0
            };
            // Frames before the first wrap around to those at the end.
            let index = frame.wrapping_add_signed(k);
            let [x, y, z, _] = normals(seed, Purpose::Tremor, index, 0);
            let [p, q, r, _] = normals(seed, Purpose::Tremor, index, 1);
            shift += weight * Vector3::new(x, y, z);
            turn += weight * Vector3::new(p, q, r);
            squares += weight * weight;
        }
        let scale = 1.0 / f64::sqrt(squares);
        let about_origin = Isometry3::new(
            shift * self.shift_mm * scale,
            turn * self.turn_deg.to_radians() * scale,
        );
        let pivot = Translation3::from(pivot.coords);
        pivot * about_origin * pivot.inverse()
    }
}
