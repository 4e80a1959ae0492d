//! Scar of a growth plate: a thin sheet of denser spongy bone across the end of a long bone.

use nalgebra::{Point3, Unit, Vector3};

use super::placement::Placement;

/// Standard deviation of the profile across the sheet, mm, and the increase at its centre, HU. Assumed: it is visible as a
/// thin line in radiographs of adults.
const SHEET_MM: f64 = 0.4;
const SHEET_HU: f64 = 220.0;
/// Standard deviation of a hump across its width, mm.
const HUMP_WIDTH_MM: f64 = 6.0;

/// A sheet across a bone, level except for humps and hollows.
#[derive(Debug, Clone)]
pub(super) struct PhysealScar {
    /// Points on the level sheet, and the height of the hump above each, mm.
    pub humps: Vec<(Point3<f64>, f64)>,
    /// Direction along the bone, away from the joint.
    pub axis: Unit<Vector3<f64>>,
    /// A point on the level sheet.
    pub level: Point3<f64>,
    /// Ratio of lengths to those of P01.
    pub size: f64,
}

impl PhysealScar {
    /// The scar at another place, size and orientation.
    pub(super) fn placed(&self, to: &Placement) -> Self {
        Self {
            humps: self
                .humps
                .iter()
                .map(|(place, mm)| (to * place, mm * to.scaling()))
                .collect(),
            axis: to.isometry.rotation * self.axis,
            level: to * self.level,
            size: self.size * to.scaling(),
        }
    }

    /// Contribution of the scar to the HU of a voxel of this width.
    pub(super) fn hu(&self, p: &Point3<f64>, width_mm: f64) -> f64 {
        let mut height = (p - self.level).dot(&self.axis);
        for (place, mm) in &self.humps {
            let q = p - place;
            let aside = (q - self.axis.scale(q.dot(&self.axis))).norm();
            let aside = aside / (HUMP_WIDTH_MM * self.size);
            height -= mm * (-0.5 * aside * aside).exp();
        }
        // A voxel widens the profile and preserves its sum.
        let sheet_mm = SHEET_MM * self.size;
        let wide = (sheet_mm * sheet_mm + width_mm * width_mm / 12.0).sqrt();
        SHEET_HU * sheet_mm / wide * (-0.5 * (height / wide).powi(2)).exp()
    }
}
