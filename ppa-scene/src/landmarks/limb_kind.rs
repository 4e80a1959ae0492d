//! Kind of limb and joint.

use serde::{Deserialize, Serialize};

/// What kind of limb a scan shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LimbKind {
    /// Lower leg with its ankle.
    LowerLeg,
    /// Knee with parts of thigh or lower leg.
    Knee,
    /// Anything else: the reference level is the middle of the limb unless it is given.
    Other,
}

/// A joint to be found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Joint {
    /// Tibia above talus.
    Ankle,
    /// Femur above tibia.
    Knee,
}

impl std::fmt::Display for Joint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Ankle => "ankle",
            Self::Knee => "knee",
        })
    }
}
