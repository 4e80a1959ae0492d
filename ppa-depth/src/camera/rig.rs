//! The two cameras on an x-ray device.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Point3, Vector3};
use ppa_core::RigidError;
use serde::{Deserialize, Serialize};

use crate::camera::depth_mode::DepthMode;
use crate::camera::rigid::{isometry_from_rows, rows_from_isometry};
use crate::camera::spec::{CameraError, CameraSpec};
use crate::camera::viewpoint::looking_at;

/// A camera and its mounting pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MountedCamera {
    /// Intrinsics.
    pub camera: CameraSpec,
    /// Rigid motion from the camera frame to the device frame: row-major 4x4, mm.
    pub device_from_camera: [[f64; 4]; 4],
}

/// Left and right camera of an x-ray device.
///
/// Device frame: origin at the x-ray source, z along the central beam towards the detector, x as the room's x, y towards
/// the patient's feet.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigSpec {
    /// Camera at negative x of the device (view V1 of the paper).
    pub left: MountedCamera,
    /// Camera at positive x of the device (view V2 of the paper).
    pub right: MountedCamera,
}

/// Reason why a camera rig could not be read or is invalid.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RigError {
    /// The file cannot be read.
    #[error("cannot read camera rig {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file is not a rig JSON.
    #[error("{} is not a camera rig JSON", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// Error of the parser, with line and column.
        source: serde_json::Error,
    },
    /// A file describes an invalid rig.
    #[error("{}", path.display())]
    Rig {
        /// The file.
        path: PathBuf,
        /// Cause.
        source: Box<RigError>,
    },
    /// The intrinsics of one camera are invalid.
    #[error("{side} camera of the rig")]
    Camera {
        /// `left` or `right`.
        side: &'static str,
        /// Cause.
        source: CameraError,
    },
    /// The pose of one camera is not a rigid motion.
    #[error("device_from_camera of the {side} camera of the rig")]
    Pose {
        /// `left` or `right`.
        side: &'static str,
        /// Cause.
        source: RigidError,
    },
}

/// Offset of either camera from the source across the device, mm.
const MOUNT_X_MM: f64 = 220.0;
/// Offset of the cameras down the beam, mm.
const MOUNT_Z_MM: f64 = 60.0;
/// Distance from the source to the point both cameras look at, mm.
const ISOCENTRE_MM: f64 = 1040.0;

impl Default for RigSpec {
    /// Two Azure Kinects on the tube housing, 220 mm to either side and 60 mm below the source, tilted about the device's
    /// y axis so that both look at the isocentre 1040 mm down the beam; image rows run along the device's y.
    fn default() -> Self {
        let mounted = |x_mm: f64| MountedCamera {
            camera: CameraSpec::azure_kinect(DepthMode::NfovUnbinned),
            device_from_camera: rows_from_isometry(&looking_at_isocentre(x_mm)),
        };
        Self {
            left: mounted(-MOUNT_X_MM),
            right: mounted(MOUNT_X_MM),
        }
    }
}

fn looking_at_isocentre(x_mm: f64) -> Isometry3<f64> {
    let position = Point3::new(x_mm, 0.0, MOUNT_Z_MM);
    looking_at(
        &position,
        &Point3::new(0.0, 0.0, ISOCENTRE_MM),
        &Vector3::y(),
    )
}

impl MountedCamera {
    /// [`device_from_camera`](Self#structfield.device_from_camera) as a rigid motion.
    ///
    /// # Errors
    /// [`RigidError`] if the matrix scales, shears, mirrors or is transposed.
    pub fn pose(&self) -> Result<Isometry3<f64>, RigidError> {
        isometry_from_rows(&self.device_from_camera)
    }
}

impl RigSpec {
    /// Reads and checks a rig JSON: `{"left": {"camera": {…}, "device_from_camera": [[…], …]}, "right": {…}}`.
    ///
    /// # Errors
    /// [`RigError`] names the file, or the camera and the number at fault.
    pub fn read(path: &Path) -> Result<Self, RigError> {
        let text =
            ppa_core::regular_file::read_to_string(path).map_err(|source| RigError::Read {
                path: path.into(),
                source,
            })?;
        let rig: Self = serde_json::from_str(&text).map_err(|source| RigError::Json {
            path: path.into(),
            source,
        })?;
        rig.check().map_err(|source| RigError::Rig {
            path: path.into(),
            source: source.into(),
        })?;
        Ok(rig)
    }

    /// Checks that both cameras are valid and their poses rigid.
    ///
    /// # Errors
    /// [`RigError::Camera`] or [`RigError::Pose`].
    pub fn check(&self) -> Result<(), RigError> {
        for (side, mounted) in [("left", &self.left), ("right", &self.right)] {
            mounted
                .camera
                .check()
                .map_err(|source| RigError::Camera { side, source })?;
            mounted
                .pose()
                .map_err(|source| RigError::Pose { side, source })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Camera;

    #[test]
    fn default_cameras_look_at_the_isocentre_with_rows_along_y() {
        let rig = RigSpec::default();
        rig.check().unwrap();
        for (mounted, x_mm) in [(&rig.left, -220.0), (&rig.right, 220.0)] {
            let device_from_camera = mounted.pose().unwrap();
            assert!(
                (device_from_camera * Point3::origin() - Point3::new(x_mm, 0.0, 60.0)).norm()
                    < 1e-9
            );
            let isocentre = device_from_camera.inverse() * Point3::new(0.0, 0.0, 1040.0);
            assert!(isocentre.x.abs() < 1e-9 && isocentre.y.abs() < 1e-9 && isocentre.z > 1000.0);
            assert!((device_from_camera * Vector3::y() - Vector3::y()).norm() < 1e-12);
            // Both images have the room's x to the right, and the feet below.
            let camera = Camera::try_from(mounted.camera.clone()).unwrap();
            let pixel = |x, y| {
                camera
                    .project(&(device_from_camera.inverse() * Point3::new(x, y, 1040.0)))
                    .unwrap()
            };
            assert!(pixel(50.0, 0.0).x > pixel(0.0, 0.0).x + 10.0);
            assert!(pixel(0.0, 50.0).y > pixel(0.0, 0.0).y + 10.0);
        }
    }

    #[test]
    fn a_rig_survives_its_file_and_a_sheared_one_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rig.json");
        let mut rig = RigSpec::default();
        std::fs::write(&path, serde_json::to_string(&rig).unwrap()).unwrap();
        assert_eq!(RigSpec::read(&path).unwrap(), rig);

        rig.right.device_from_camera[0][1] += 0.1;
        std::fs::write(&path, serde_json::to_string(&rig).unwrap()).unwrap();
        let wrong = |path: &Path| match RigSpec::read(path) {
            Err(RigError::Rig {
                path: named,
                source,
            }) if named == path => *source,
            other => panic!("{other:?}"),
        };
        assert!(matches!(wrong(&path), RigError::Pose { side: "right", .. }));
        rig = RigSpec::default();
        rig.left.camera.fx = -1.0;
        std::fs::write(&path, serde_json::to_string(&rig).unwrap()).unwrap();
        assert!(matches!(
            wrong(&path),
            RigError::Camera { side: "left", .. }
        ));
        assert!(matches!(
            RigSpec::read(&folder.path().join("none.json")),
            Err(RigError::Read { .. })
        ));
    }
}
