//! Depth modes of the Azure Kinect and of Orbbec's Femto cameras, which share its sensor.

use serde::{Deserialize, Serialize};

use crate::camera::field_mask::FieldMask;

/// Which part of the 1024 x 1024 sensor is read, and whether 2 x 2 pixels become one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DepthMode {
    /// Narrow field of view, 640 x 576.
    NfovUnbinned,
    /// Narrow field of view, 2 x 2 pixels in one, 320 x 288.
    NfovBinned,
    /// Wide field of view, 1024 x 1024.
    WfovUnbinned,
    /// Wide field of view, 2 x 2 pixels in one, 512 x 512.
    WfovBinned,
}

/// The window of a mode: all in pixels of the mode.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Window {
    /// Side of the whole sensor.
    pub sensor: f64,
    /// First column and row of the sensor that are read.
    pub crop: [f64; 2],
    /// Columns and rows.
    pub size: [u32; 2],
}

impl DepthMode {
    /// Windows as in the public Azure Kinect Sensor SDK (`mode_specific_calibration.c`).
    pub(crate) fn window(self) -> Window {
        let (sensor, crop, size) = match self {
            Self::NfovUnbinned => (1024.0, [192.0, 180.0], [640, 576]),
            Self::NfovBinned => (512.0, [96.0, 90.0], [320, 288]),
            Self::WfovUnbinned => (1024.0, [0.0, 0.0], [1024, 1024]),
            Self::WfovBinned => (512.0, [0.0, 0.0], [512, 512]),
        };
        Window { sensor, crop, size }
    }

    /// The part of the image that the mode's illumination reaches, as an ideal figure: a hexagon of 75° x 65° for the narrow
    /// modes, a circle of 120° for the wide ones (fields of interest of the Azure Kinect's hardware specification).
    ///
    /// The pixels that a particular device never fills differ from it at the rim.
    pub fn mask(self) -> FieldMask {
        match self {
            Self::NfovUnbinned | Self::NfovBinned => FieldMask::Hexagon {
                width_deg: 75.0,
                height_deg: 65.0,
            },
            Self::WfovUnbinned | Self::WfovBinned => FieldMask::Circle {
                diameter_deg: 120.0,
            },
        }
    }
}
