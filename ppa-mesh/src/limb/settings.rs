//! Settings of limb extraction.

use serde::{Deserialize, Serialize};

/// A box of voxels, half-open: `low` is inside, `high` is not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VoxelBox {
    /// First voxel (i, j, k).
    pub low: [usize; 3],
    /// One past the last voxel (i, j, k).
    pub high: [usize; 3],
}

/// A ball of the scan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ball {
    /// Centre in the `ct` frame, mm.
    pub centre_mm: [f64; 3],
    /// Radius, mm.
    pub radius_mm: f64,
}

/// Choices of [`extract_limb`](crate::extract_limb); the default suits limbs in diagnostic CT.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LimbSettings {
    /// HU of the skin surface, half-way between air and soft tissue.
    pub iso_hu: f64,
    /// Part of the volume to look at; all of it when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub crop: Option<VoxelBox>,
    /// A point of the wanted limb in the `ct` frame, mm, when the automatic choice is not wanted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inside: Option<[f64; 3]>,
    /// Points of further bodies that are kept as parts of the limb, `ct` frame, mm: a splint, or a part that only touches the
    /// limb. Their voxels are those of the limb in all that follows.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub kept: Vec<[f64; 3]>,
    /// Balls of the scan in which nothing is limb: they cut something off. Of what a cut separates, the limb is the body that is chosen.
    /// A ball that the limb encloses on all sides stays limb, as any hollow does.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub removed: Vec<Ball>,
    /// Of several limbs alike, side by side in this direction of the `ct` frame, take the one farthest along it;
    /// when absent the one with the most bone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub towards: Option<[f64; 3]>,
    /// HU that only bone (or metal) exceeds in bulk; the limb is what holds most of it.
    pub bone_hu: f64,
    /// HU that solid flesh exceeds but cloth and foam blurred with air do not.
    pub core_hu: f64,
    /// Structures thinner than twice this (couch shells, sheets) are not limb, mm.
    pub core_radius_mm: f64,
    /// Two bodies touch rather than being one when the neck between them is thinner than this
    /// fraction of the thinner body.
    pub neck_ratio: f64,
    /// A column along the scan axis may be couch when it is solid in at least this fraction of slices;
    /// above 1 nothing is.
    pub couch_persistence: f64,
    /// Couch shells are thinner than this across the scan axis, mm.
    pub couch_thickness_mm: f64,
    /// Neighbourhood of the clustering that drops specks of surface, mm.
    pub dbscan_eps_mm: f64,
    /// Points within that neighbourhood that make a core point.
    pub dbscan_min_points: usize,
}

impl Default for LimbSettings {
    fn default() -> Self {
        Self {
            iso_hu: -500.0,
            crop: None,
            inside: None,
            kept: Vec::new(),
            removed: Vec::new(),
            towards: None,
            bone_hu: 200.0,
            core_hu: -250.0,
            core_radius_mm: 4.0,
            neck_ratio: 0.5,
            couch_persistence: 0.85,
            couch_thickness_mm: 10.0,
            dbscan_eps_mm: 6.0,
            dbscan_min_points: 8,
        }
    }
}
