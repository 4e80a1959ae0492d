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

/// Settings of [`extract_limb`](crate::extract_limb); the default suits limbs in diagnostic CT.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LimbSettings {
    /// HU of the skin surface, half-way between air and soft tissue.
    pub iso_hu: f64,
    /// Part of the volume to search; all of it by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub crop: Option<VoxelBox>,
    /// A point in the wanted limb, `ct` frame, mm, to replace the automatic choice.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inside: Option<[f64; 3]>,
    /// Points in other bodies that are kept as parts of the limb, `ct` frame, mm: a splint, or a part that only touches the limb. Their
    /// voxels then count as voxels of the limb.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub kept: Vec<[f64; 3]>,
    /// Balls in which nothing counts as limb, to cut something off. If that separates bodies, the limb is the one that is chosen. A ball
    /// that the limb encloses on all sides remains limb, like any cavity.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub removed: Vec<Ball>,
    /// Direction in the `ct` frame: of several similar limbs side by side along it, the one farthest along it is taken; when absent, the
    /// one with the most bone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub towards: Option<[f64; 3]>,
    /// HU that only bone (or metal) exceeds in bulk; the limb is the body with most of it.
    pub bone_hu: f64,
    /// HU that solid flesh exceeds but cloth and foam blurred with air do not.
    pub core_hu: f64,
    /// Structures thinner than twice this (couch shells, sheets) are not limb, mm.
    pub core_radius_mm: f64,
    /// Two bodies count as touching, not as one, when the neck between them is thinner than this fraction of the thinner body.
    pub neck_ratio: f64,
    /// Smallest fraction of slices in which a column along the scan axis must be solid to be considered couch; above 1, no column is.
    pub couch_persistence: f64,
    /// Couch shells are thinner than this across the scan axis, mm.
    pub couch_thickness_mm: f64,
    /// Neighbourhood radius of the clustering that removes specks of surface, mm.
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
