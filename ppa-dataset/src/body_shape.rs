//! The paper's body shapes: the limb as it is, and four variants of its skin.

use serde::{Deserialize, Serialize};

/// A variant of the skin. The bones, and therefore the radiograph and its label, are the same in all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BodyShape {
    /// The skin of the scan.
    Orig,
    /// Moved outwards along the normals.
    Big,
    /// Moved inwards along the normals.
    Small,
    /// Gaussian bumps near the joint and on the shin, first draw.
    BumpsA,
    /// Gaussian bumps, second draw.
    BumpsB,
}

impl BodyShape {
    /// The five shapes of the paper.
    pub const ALL: [Self; 5] = [
        Self::Orig,
        Self::Big,
        Self::Small,
        Self::BumpsA,
        Self::BumpsB,
    ];

    /// Folder name in the dataset.
    pub fn name(self) -> &'static str {
        match self {
            Self::Orig => "orig",
            Self::Big => "big",
            Self::Small => "small",
            Self::BumpsA => "bumps_a",
            Self::BumpsB => "bumps_b",
        }
    }
}
