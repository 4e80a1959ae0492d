//! Position of the x-ray source and the detector.

use nalgebra::{Matrix3, Point3, Vector3};
use serde::{Deserialize, Serialize};

use crate::frames::Room;
use crate::frames::{Device, Rigid};

/// Pose and focus-detector distance of an x-ray device.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct XrayDevice {
    /// Source at the origin, z along the central beam towards the detector, −y towards the
    /// head end of the table.
    pub room_from_device: Rigid<Room, Device>,
    /// Distance of the detector from the source along the central beam, mm.
    pub source_detector_mm: f64,
}

impl XrayDevice {
    /// A device above the room's origin whose beam points straight down (−z of the room), with
    /// the head end of the table towards +y.
    pub fn overhead(source_height_mm: f64, source_detector_mm: f64) -> Self {
        let axes = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
        Self {
            room_from_device: Rigid::from_axes(axes, Point3::new(0.0, 0.0, source_height_mm)),
            source_detector_mm,
        }
    }

    /// The focal spot in the room.
    pub fn source(&self) -> Point3<f64> {
        self.room_from_device * Point3::origin()
    }

    /// Unit direction of the central beam in the room.
    pub fn beam_direction(&self) -> Vector3<f64> {
        self.room_from_device.rotate(&Vector3::z())
    }

    /// Unit direction in the room from the feet towards the head of a patient on the table.
    pub fn head_direction(&self) -> Vector3<f64> {
        self.room_from_device.rotate(&-Vector3::y())
    }
}
