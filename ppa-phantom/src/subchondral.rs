//! Subchondral plates: below the surfaces of a joint the cortex is thicker than elsewhere, and its thickness varies.

use nalgebra::{Point3, Unit, Vector3};

use super::placement::Placement;
use super::smooth::smooth_step;

/// A surface is wholly that of a joint up to so much more than the gap of the joint from the other bone, and not at all
/// from so much more on, mm.
const JOINT_ENDS_MM: [f64; 2] = [0.5, 5.0];
/// No plate is thicker, mm.
const THICKEST_MM: f64 = 2.0;

/// A surface of a bone in a joint.
#[derive(Debug, Clone)]
pub(super) struct JointSurface {
    /// Index of the bone across the joint.
    pub other: usize,
    /// Gap between both bones, mm.
    pub gap_mm: f64,
    /// Thickness of the plate in the middle of the surface and at its sides, mm.
    pub plate_mm: [f64; 2],
    pub middle: Point3<f64>,
    /// From the middle to either side.
    pub across: Unit<Vector3<f64>>,
    /// How far the sides are from the middle, mm.
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

    /// Farthest from the other bone that a point of the plate, or one within `reach_mm` of it, can be.
    pub(super) fn farthest_mm(&self, reach_mm: f64) -> f64 {
        self.gap_mm + JOINT_ENDS_MM[1] + THICKEST_MM + reach_mm
    }

    /// Thickness of the cortex at a point of the bone, whose cortex is `shell_mm` thick away from joints, by the sum of the signed
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

/// Whether a point at this signed distance to the surface of a bone lies within `reach_mm` of what a plate may fill.
pub(super) fn plate_near(distance_mm: f64, reach_mm: f64) -> bool {
    distance_mm > -(THICKEST_MM + reach_mm)
}
