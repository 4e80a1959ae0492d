//! Regions of interest of depth images.

use serde::{Deserialize, Serialize};

/// Region of interest: the square of a depth image around the joint, columns `x_start..x_start + size`, rows
/// `y_start..y_start + size`. It may reach beyond the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Roi {
    /// First column.
    pub x_start: u32,
    /// First row.
    pub y_start: u32,
    /// Number of columns and rows.
    pub size: u32,
}
