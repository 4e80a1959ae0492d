//! Subchondral plates: the cortex is thicker below the surfaces of a joint than elsewhere, and its thickness varies.

use nalgebra::{Point3, Unit, Vector3};

use super::placement::Placement;
use super::smooth::smooth_step;

/// Distances to the other bone, beyond the gap of the joint, up to which a surface is fully part of the joint and from
/// which it is not part of it, mm.
const JOINT_ENDS_MM: [f64; 2] = [0.5, 5.0];
/// Largest thickness of a plate, mm.
const THICKEST_MM: f64 = 2.0;

/// A joint surface of a bone.
#[derive(Debug, Clone)]
pub(super) struct JointSurface {
    /// Index of the bone across the joint.
    pub other: usize,
    /// Gap between both bones, mm.
    pub gap_mm: f64,
    /// Thickness of the plate in the middle of the surface and at its sides, mm.
    pub plate_mm: [f64; 2],
    pub middle: Point3<f64>,
    /// Direction from the middle to either side.
    pub across: Unit<Vector3<f64>>,
    /// Distance from the middle to the sides, mm.
    pub reach_mm: f64,
}

impl JointSurface {
    /// The surface of a bone at another place, size and orientation.
    pub(super) fn placed(&self, to: &Placement) -> Self {
        let size = to.scaling();
        Self {
            other: self.other,
            gap_mm: self.gap_mm * size,
            plate_mm: self.plate_mm.map(|mm| mm * size),
            middle: to * self.middle,
            across: to.isometry.rotation * self.across,
            reach_mm: self.reach_mm * size,
        }
    }

    /// Largest distance to the other bone of a point of the plate, or of one within `reach_mm` of it.
    pub(super) fn farthest_mm(&self, reach_mm: f64) -> f64 {
        self.gap_mm + JOINT_ENDS_MM[1] + THICKEST_MM + reach_mm
    }

    /// Thickness of the cortex at a point of the bone, which is `shell_mm` away from joints. `apart_mm` is the sum of the signed
    /// distances to both bones: on lines across a joint it is the gap.
    pub(super) fn cortex_mm(&self, p: &Point3<f64>, shell_mm: f64, apart_mm: f64) -> f64 {
        let [whole, none] = JOINT_ENDS_MM.map(|mm| self.gap_mm + mm);
        let share = smooth_step(none, whole, apart_mm);
        let [middle, side] = self.plate_mm;
        let aside = ((p - self.middle).dot(&self.across) / self.reach_mm)
            .abs()
            .min(1.0);
        let plate_mm = middle + aside * aside * (side - middle);
        shell_mm + share * (plate_mm - shell_mm).max(0.0)
    }
}

/// Whether a point at this signed distance to the surface of a bone is within `reach_mm` of the deepest possible plate.
pub(super) fn plate_near(distance_mm: f64, reach_mm: f64) -> bool {
    distance_mm > -(THICKEST_MM + reach_mm)
}
