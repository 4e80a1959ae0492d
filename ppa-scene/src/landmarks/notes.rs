//! Notes on how landmarks were decided.

use crate::landmarks::knee_axis::KneeAxis;
use crate::landmarks::limb_kind::Joint;

/// A fact about the landmarks of a limb, for the user to judge.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum LandmarkNote {
    /// The gap between tibial plafond and talar dome was found.
    AnkleFound {
        /// How much darker the gap is than the bone on either side, HU.
        depth_hu: f64,
        /// How far the joint is proximal of the gap: 0 unless the user gave the joint, mm.
        joint_above_mm: f64,
    },
    /// The scan shows another joint than the one the limb is posed about.
    OtherJoint {
        /// The other joint.
        joint: Joint,
        /// Its centre, `ct` frame, mm.
        at_mm: [f64; 3],
    },
    /// The scan cuts the tibial plateau of a knee: the notch between its condyles replaces the middle.
    PlateauCut,
    /// Which shafts give the axis of a knee.
    KneeAxis(KneeAxis),
    /// The scan does not show the back of both condyles: the front of a knee is that of the scan.
    CondylesNotSeen,
    /// The joint, given by the user or found, is off an axis given by the user, and was moved onto it.
    JointMovedToAxis {
        /// Distance moved, mm.
        aside_mm: f64,
    },
    /// The joint centre lies outside of the limb.
    JointOutside {
        /// Distance to the nearest voxel of the limb, mm.
        distance_mm: f64,
    },
    /// The anterior direction points to the back of the patient.
    AnteriorReversed {
        /// Angle to the scan's anterior direction (−y) across the axis, degrees.
        angle_deg: f64,
    },
    /// The user gave the supporting plane.
    PlaneGiven {
        /// Share of the skin behind it.
        behind_percent: f64,
        /// Largest distance of the skin behind it, mm.
        deepest_mm: f64,
    },
}
