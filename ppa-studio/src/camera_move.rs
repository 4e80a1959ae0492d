//! Cameras moved from their places in the plan.

use nalgebra::{Translation3, UnitQuaternion, Vector3};
use ppa_depth::{MountedCamera, RigidError, rows_from_isometry};
use serde::{Deserialize, Serialize};

use crate::error::StudioError;

/// Farthest shift along an axis, mm.
const FARTHEST_MM: f64 = 3000.0;

/// Shift and rotation of a camera.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct CameraMove {
    /// Shift along the axes of the device: x, y towards the patient's feet, z along the central beam.
    pub shift_mm: [f64; 3],
    /// Rotations about the camera's axes, in this order: view direction (roll), image rows (tilt), image columns (pan).
    pub turn_deg: [f64; 3],
}

impl CameraMove {
    /// # Errors
    /// [`StudioError::Invalid`] for a shift beyond 3 m or a rotation beyond 180 degrees.
    pub fn check(&self) -> Result<(), StudioError> {
        let within = |values: &[f64; 3], most: f64| values.iter().all(|v| v.abs() <= most);
        if within(&self.shift_mm, FARTHEST_MM) && within(&self.turn_deg, 180.0) {
            return Ok(());
        }
        Err(StudioError::Invalid(format!(
            "a camera is shifted by {:?} mm and rotated by {:?} degrees, expected at most {FARTHEST_MM} mm and 180 degrees",
            self.shift_mm, self.turn_deg
        )))
    }

    /// Moves a camera.
    ///
    /// # Errors
    /// [`RigidError`] if the pose of the camera is not a rigid motion.
    pub fn apply(&self, mounted: &mut MountedCamera) -> Result<(), RigidError> {
        let [roll, tilt, pan] = self.turn_deg.map(f64::to_radians);
        let about = |axis: &nalgebra::Unit<Vector3<f64>>, angle| {
            UnitQuaternion::from_axis_angle(axis, angle)
        };
        let turn = about(&Vector3::y_axis(), pan)
            * about(&Vector3::x_axis(), tilt)
            * about(&Vector3::z_axis(), roll);
        let moved = Translation3::from(self.shift_mm) * mounted.pose()? * turn;
        mounted.device_from_camera = rows_from_isometry(&moved);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;
    use ppa_depth::RigSpec;

    #[test]
    fn a_shift_moves_the_centre_and_a_turn_the_view() {
        let before = RigSpec::default().left;
        let mut mounted = before.clone();
        let [pan, tilt] = [30.0_f64, 20.0];
        let moves = CameraMove {
            shift_mm: [10.0, -20.0, 30.0],
            turn_deg: [40.0, tilt, pan],
        };
        moves.check().unwrap();
        moves.apply(&mut mounted).unwrap();
        let (old, new) = (before.pose().unwrap(), mounted.pose().unwrap());
        let moved = new * Point3::origin() - old * Point3::origin();
        assert!((moved - Vector3::new(10.0, -20.0, 30.0)).norm() < 1e-9);
        // Roll does not change where the camera looks.
        let [old_view, new_view] = [old * Vector3::z(), new * Vector3::z()];
        let cos = pan.to_radians().cos() * tilt.to_radians().cos();
        assert!((old_view.dot(&new_view) - cos).abs() < 1e-12);
        // Pan rotates the view towards the image's right, where x points.
        let right = (old * Vector3::x()).dot(&new_view);
        assert!((right - pan.to_radians().sin() * tilt.to_radians().cos()).abs() < 1e-12);
        // Tilt rotates it towards the image's top, against y.
        let down = (old * Vector3::y()).dot(&new_view);
        assert!((down + tilt.to_radians().sin()).abs() < 1e-12);
    }

    #[test]
    fn moves_out_of_range_are_refused() {
        for [shift, turn] in [[3001.0, 0.0], [0.0, 181.0], [f64::NAN, 0.0]] {
            let moves = CameraMove {
                shift_mm: [0.0, shift, 0.0],
                turn_deg: [turn, 0.0, 0.0],
            };
            assert!(moves.check().is_err());
        }
    }
}
