//! Scar of a growth plate: a thin sheet of denser spongy bone across the end of a long bone.

use nalgebra::{Point3, Unit, Vector3};

use super::placement::Placement;

/// Half-thickness of the sheet, as the standard deviation of its profile, mm; and what it adds in its middle, HU. Assumed: it shows
/// as a thin line in radiographs of adults.
const SHEET_MM: f64 = 0.4;
const SHEET_HU: f64 = 300.0;
/// Standard deviation of the hump over its width, mm.
const HUMP_WIDTH_MM: f64 = 6.0;

/// A sheet across a bone, level but for one hump.
#[derive(Debug, Clone)]
pub(super) struct PhysealScar {
    /// On the level part of the sheet, below the top of the hump.
    pub below_hump: Point3<f64>,
    /// Along the bone, away from the joint.
    pub axis: Unit<Vector3<f64>>,
    /// Height of the hump, mm.
    pub hump_mm: f64,
    /// Lengths over those of P01.
    pub size: f64,
}

impl PhysealScar {
    /// The scar at another place, size and orientation.
    pub(super) fn placed(&self, to: &Placement) -> Self {
        Self {
            below_hump: to * self.below_hump,
            axis: to.isometry.rotation * self.axis,
            hump_mm: self.hump_mm * to.scaling(),
            size: self.size * to.scaling(),
        }
    }

    /// What the scar adds to the HU of a voxel of this width.
    pub(super) fn hu(&self, p: &Point3<f64>, width_mm: f64) -> f64 {
        let q = p - self.below_hump;
        let station = q.dot(&self.axis);
        let aside = (q - self.axis.scale(station)).norm() / (HUMP_WIDTH_MM * self.size);
        let height = station - self.hump_mm * (-0.5 * aside * aside).exp();
        // A voxel widens the profile and keeps its sum.
        let sheet_mm = SHEET_MM * self.size;
        let wide = (sheet_mm * sheet_mm + width_mm * width_mm / 12.0).sqrt();
        SHEET_HU * sheet_mm / wide * (-0.5 * (height / wide).powi(2)).exp()
    }
}
