//! What was found and what was cut away.

use serde::{Deserialize, Serialize};

/// A body found in the volume, before one was chosen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Body {
    /// Whether this is the limb.
    pub chosen: bool,
    /// Volume of its solid core, mm³.
    pub core_mm3: f64,
    /// Volume of bone in the core, mm³.
    pub bone_mm3: f64,
    /// Cross-section lost at the side faces of the volume, mm².
    pub side_cut_mm2: f64,
    /// Middle of the core in the `ct` frame, mm.
    pub centre_mm: [f64; 3],
}

/// A face of the volume that cuts the limb.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CutFace {
    /// `-i`, `+i`, `-j`, `+j`, `-k` or `+k`.
    pub face: String,
    /// Area of the limb in that face, mm².
    pub area_mm2: f64,
}

/// How the limb was found.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct LimbReport {
    /// Solid bodies, the one with the most bone first.
    pub bodies: Vec<Body>,
    /// Columns along the scan axis that are couch.
    pub couch_columns: usize,
    /// Voxels of couch removed.
    pub couch_voxels: usize,
    /// Further voxels above the iso value that are not limb: sheets, other bodies, noise.
    pub other_voxels: usize,
    /// Voxels below the iso value enclosed by the limb, counted as limb.
    pub interior_voxels: usize,
    /// Voxels of islands that were not connected with the limb.
    pub island_voxels: usize,
    /// Clusters of surface points found by DBSCAN.
    pub clusters: usize,
    /// Surface points removed: noise, small clusters, separate pieces.
    pub points_removed: usize,
    /// Points of the skin surface.
    pub points: usize,
    /// Voxels of the limb.
    pub limb_voxels: usize,
    /// Volume of the limb, mm³.
    pub limb_mm3: f64,
    /// Voxels the limb spans, half-open.
    pub low: [usize; 3],
    /// One past the last voxel of the limb.
    pub high: [usize; 3],
    /// Faces of the volume (or crop) that cut the limb; the mesh is open there.
    pub cut_faces: Vec<CutFace>,
}
