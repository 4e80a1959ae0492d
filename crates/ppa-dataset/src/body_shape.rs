//! The paper's body shapes: the limb as it is, and four variants of its skin.

use ppa_mesh::{Mesh, add_bumps, offset, seeded_bumps};
use ppa_scene::{Landmarks, bump_sites};
use serde::{Deserialize, Serialize};

use crate::layout::LimbId;
use crate::seed::{Purpose, item_seed};

/// A variant of the skin. The bones, and so the radiograph and its label, are the same in all.
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

/// How far the variants depart from the scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ShapeSettings {
    /// The shapes to render.
    pub variants: Vec<BodyShape>,
    /// Shift of `big` outwards and of `small` inwards, mm.
    pub offset_mm: f64,
    /// Bumps of `bumps_a` and of `bumps_b`; the paper places 2 to 3.
    pub bumps: [usize; 2],
}

impl Default for ShapeSettings {
    fn default() -> Self {
        Self {
            variants: BodyShape::ALL.to_vec(),
            offset_mm: 4.0,
            bumps: [2, 3],
        }
    }
}

/// The skin of one variant, in the frame of `skin` (ct, mm).
///
/// # Errors
/// When the skin has no points where bumps belong (near the joint and on the shin).
pub fn body_shape(
    skin: &Mesh,
    landmarks: &Landmarks,
    shape: BodyShape,
    settings: &ShapeSettings,
    limb: LimbId,
    seed: u64,
) -> Result<Mesh, ppa_mesh::BumpError> {
    let bumped = |draw: u32| {
        let seed = item_seed(seed, Purpose::Bumps, limb, draw);
        let count = settings.bumps[draw as usize];
        let bumps = seeded_bumps(skin, &bump_sites(landmarks), count, seed)?;
        add_bumps(skin, &bumps)
    };
    match shape {
        BodyShape::Orig => Ok(skin.clone()),
        BodyShape::Big => Ok(offset(skin, settings.offset_mm)),
        BodyShape::Small => Ok(offset(skin, -settings.offset_mm)),
        BodyShape::BumpsA => bumped(0),
        BodyShape::BumpsB => bumped(1),
    }
}
