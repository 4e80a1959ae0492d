//! Notes on how landmarks were decided.

use crate::landmarks::knee_axis::KneeAxis;
use crate::landmarks::limb_kind::Joint;

/// A fact about the landmarks of a limb, for the person who judges them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum LandmarkNote {
    /// The gap between tibial plafond and talar dome was found.
    AnkleFound {
        /// How much darker the gap is than the bone on either side, HU.
        depth_hu: f64,
        /// How far the joint lies proximal of the gap: 0 unless a person gave the joint, mm.
        joint_above_mm: f64,
    },
    /// The scan shows another joint than the one the limb is posed about.
    OtherJoint {
        /// Which one.
        joint: Joint,
        /// Its centre, `ct` frame, mm.
        at_mm: [f64; 3],
    },
    /// The scan cuts the tibial plateau of a knee: the notch between its condyles stands for the middle.
    PlateauCut,
    /// Which shafts give the axis of a knee.
    KneeAxis(KneeAxis),
    /// The scan does not show the back of both condyles: the front of a knee is the scan's.
    CondylesNotSeen,
    /// The joint given by a person, or found, lies beside an axis that a person gave, and was moved on to it.
    JointMovedToAxis {
        /// How far, mm.
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
    /// A person gave the supporting plane.
    PlaneGiven {
        /// Share of the skin behind it.
        behind_percent: f64,
        /// How far that reaches behind it, mm.
        deepest_mm: f64,
    },
}
