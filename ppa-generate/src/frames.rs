//! Named poses of everything in a room, for use in other programs.

use std::collections::BTreeMap;

use ppa_core::TransformRows;
use ppa_depth::{RigSpec, rows_from_isometry};
use ppa_scene::{Landmarks, Placement, ct_from_device};
use serde::Serialize;

use crate::scene_setup::{SceneSetupError, Table};

/// Rigid motions by name, `target_from_source`: row-major 4x4, mm.
///
/// A point (x, y, z) of the source frame is at M · (x, y, z, 1) in the target frame. Frames: `ct` (LPS), `patient`, `room`, `device`,
/// `left` and `right` (cameras, OpenCV axes). `left_from_room` maps the room to the left camera, `left_from_ct` a skin in the scan: the
/// `--camera-from-mesh` of `ppa depth render`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Frames {
    /// Units and conventions of the numbers.
    pub units: &'static str,
    /// Distance of the detector from the source along z of the device.
    pub source_detector_mm: f64,
    /// Normal and offset of the table: normal · p = offset, room frame.
    pub table: [f64; 4],
    /// The motions.
    pub motions: BTreeMap<&'static str, TransformRows>,
}

impl Frames {
    /// Frames of device and cameras in their room.
    ///
    /// # Errors
    /// [`SceneSetupError::Rig`] naming the camera whose pose is invalid.
    pub fn of_room(table: &Table, rig: &RigSpec) -> Result<Self, SceneSetupError> {
        let room_from_device = table.room.device.room_from_device;
        let mut motions =
            BTreeMap::from([("room_from_device", room_from_device.to_homogeneous_rows())]);
        rig.check()?;
        for (in_device, in_room, of_room, mounted) in [
            (
                "device_from_left",
                "room_from_left",
                "left_from_room",
                &rig.left,
            ),
            (
                "device_from_right",
                "room_from_right",
                "right_from_room",
                &rig.right,
            ),
        ] {
            let device_from_camera = mounted.pose().map_err(|source| {
                let side = in_device.trim_start_matches("device_from_");
                ppa_depth::RigError::Pose { side, source }
            })?;
            motions.insert(in_device, rows_from_isometry(&device_from_camera));
            let room_from_camera = room_from_device.isometry() * device_from_camera;
            motions.insert(in_room, rows_from_isometry(&room_from_camera));
            motions.insert(of_room, rows_from_isometry(&room_from_camera.inverse()));
        }
        let plane = &table.plane.plane;
        let [x, y, z] = plane.normal.into_inner().into();
        Ok(Self {
            units: "mm; row-major target_from_source; ct: LPS; cameras: x right, y down, z forward",
            source_detector_mm: table.room.device.source_detector_mm,
            table: [x, y, z, plane.offset_mm],
            motions,
        })
    }

    /// Adds a limb: `room_from_patient` is t_opt · t_mat · t_rot.
    pub fn with_limb(
        mut self,
        placement: &Placement,
        landmarks: &Landmarks,
        table: &Table,
    ) -> Self {
        let ct_from_device = ct_from_device(placement, landmarks, &table.room.device);
        let room_from_ct = placement.room_from_patient * landmarks.patient_from_ct();
        for (of_ct, of_room) in [
            ("left_from_ct", "left_from_room"),
            ("right_from_ct", "right_from_room"),
        ] {
            if let Some(camera_from_room) = self.motions.get(of_room) {
                let camera_from_ct = product(camera_from_room, &room_from_ct.to_homogeneous_rows());
                self.motions.insert(of_ct, camera_from_ct);
            }
        }
        self.motions.extend([
            (
                "patient_from_ct",
                landmarks.patient_from_ct().to_homogeneous_rows(),
            ),
            (
                "room_from_patient",
                placement.room_from_patient.to_homogeneous_rows(),
            ),
            ("t_rot", placement.t_rot.to_homogeneous_rows()),
            ("t_mat", placement.t_mat.to_homogeneous_rows()),
            ("t_opt", placement.t_opt.to_homogeneous_rows()),
            ("ct_from_device", ct_from_device.to_homogeneous_rows()),
        ]);
        self
    }
}

fn product(a: &TransformRows, b: &TransformRows) -> TransformRows {
    std::array::from_fn(|row| {
        std::array::from_fn(|column| (0..4).map(|k| a[row][k] * b[k][column]).sum())
    })
}
