//! The skins of the paper's body shapes.

use ppa_dataset::BodyShape;
use ppa_dataset::layout::LimbId;
use ppa_mesh::{Mesh, add_bumps, offset, seeded_bumps};
use ppa_scene::{Landmarks, bump_sites};
use serde::{Deserialize, Serialize};

use crate::seed::{Purpose, item_seed};

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
) -> Result<Mesh, ppa_mesh::ShapeError> {
    let bumped = |draw: u32| {
        let seed = item_seed(seed, Purpose::Bumps, limb, draw);
        let count = settings.bumps[draw as usize];
        let bumps = seeded_bumps(skin, &bump_sites(landmarks), count, seed)?;
        add_bumps(skin, &bumps)
    };
    match shape {
        BodyShape::Orig => Ok(skin.clone()),
        BodyShape::Big => offset(skin, settings.offset_mm),
        BodyShape::Small => offset(skin, -settings.offset_mm),
        BodyShape::BumpsA => bumped(0),
        BodyShape::BumpsB => bumped(1),
    }
}
