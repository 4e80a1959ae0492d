//! Bodies found and parts cut away.

use nalgebra::Point3;
use ppa_ct::Grid;
use serde::{Deserialize, Serialize};

use super::bodies::Bodies;
use super::choice::{Kept, alike};
use super::contact::Touching;
use super::lattice::Lattice;

/// A body found in the volume, before one was chosen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Body {
    /// Whether this is the limb.
    pub chosen: bool,
    /// Whether it could be the limb: it has about as much bone as the body with the most.
    #[serde(default)]
    pub alike: bool,
    /// The given points that keep it as part of the limb; empty for other bodies.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub kept: Vec<[f64; 3]>,
    /// Volume of its solid core, mm³.
    pub core_mm3: f64,
    /// Volume of bone in the core, mm³.
    pub bone_mm3: f64,
    /// Cross-section lost at the side faces of the volume, mm².
    pub side_cut_mm2: f64,
    /// Middle of the core in the `ct` frame, mm.
    pub centre_mm: [f64; 3],
    /// A point in the core, `ct` frame, mm: its middle or, if that is outside (as in a splint), the centre of the nearest voxel of the
    /// core. Absent in cases from earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inside_mm: Option<[f64; 3]>,
}

impl Body {
    /// A point by which the body can be selected, `ct` frame, mm.
    pub fn point_mm(&self) -> [f64; 3] {
        self.inside_mm.unwrap_or(self.centre_mm)
    }
}

fn is_zero(volume_mm3: &f64) -> bool {
    *volume_mm3 == 0.0
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
    /// Area in which other bodies touch the limb, mm²; the skin there is estimated.
    #[serde(default)]
    pub contact_mm2: f64,
    /// Middle of that contact in the `ct` frame, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact_centre_mm: Option<[f64; 3]>,
    /// Tissue within the balls of [`LimbSettings::removed`](super::LimbSettings::removed), mm³.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub removed_mm3: f64,
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
    /// First voxel of the box around the limb.
    pub low: [usize; 3],
    /// One past the last voxel of the limb.
    pub high: [usize; 3],
    /// Faces of the volume (or crop) that cut the limb; the mesh is open there.
    pub cut_faces: Vec<CutFace>,
}

impl LimbReport {
    pub(super) fn describe_bodies(
        &mut self,
        grid: &Grid,
        lattice: &Lattice,
        found: &Bodies,
        points_inside: &[Point3<f64>],
        chosen: u32,
        kept: &[Kept],
    ) {
        let alike = alike(lattice, found);
        let basins = found.basins.iter().enumerate();
        self.bodies = basins
            .map(|(at, basin)| Body {
                chosen: at as u32 == chosen,
                alike: alike[at],
                kept: kept
                    .iter()
                    .find(|kept| kept.body == at as u32)
                    .map_or(Vec::new(), |kept| kept.points.clone()),
                core_mm3: basin.voxels as f64 * lattice.voxel_mm3,
                bone_mm3: basin.bone_voxels as f64 * lattice.voxel_mm3,
                side_cut_mm2: basin.side_cut_mm2,
                centre_mm: basin.centre(lattice, grid).into(),
                inside_mm: Some(points_inside[at].into()),
            })
            .collect();
        self.bodies.sort_by(|a, b| {
            b.bone_mm3
                .total_cmp(&a.bone_mm3)
                .then(b.core_mm3.total_cmp(&a.core_mm3))
        });
    }

    /// Records where other bodies touch the limb.
    pub(super) fn describe_contact(
        &mut self,
        grid: &Grid,
        lattice: &Lattice,
        touching: Option<Touching>,
    ) {
        self.contact_mm2 = touching.map_or(0.0, |touching| touching.area_mm2);
        self.contact_centre_mm = touching.map(|touching| {
            let voxel = [0, 1, 2].map(|x| touching.voxel[x] + lattice.low[x] as f64);
            grid.centre(voxel).into()
        });
    }

    /// Records the size and extent of the limb, and where the volume cuts it.
    pub(super) fn describe_limb(&mut self, lattice: &Lattice, mask: &[bool]) {
        let (mut low, mut high) = (lattice.whole, [0; 3]);
        let mut at_walls = [0_usize; 6];
        let nx = lattice.size[0];
        for (row, line) in mask.chunks(nx).enumerate() {
            let inside = line.iter().filter(|inside| **inside).count();
            let ends = [
                line.iter().position(|inside| *inside),
                line.iter().rposition(|inside| *inside),
            ];
            let [Some(first), Some(last)] = ends else {
                continue;
            };
            self.limb_voxels += inside;
            for (end, i) in [first, last].into_iter().enumerate() {
                let voxel = lattice.voxel(row * nx + i);
                for axis in 0..3 {
                    let place = voxel[axis] + lattice.low[axis];
                    low[axis] = low[axis].min(place);
                    high[axis] = high[axis].max(place + 1);
                }
                at_walls[end] += usize::from(lattice.at_walls(voxel, 0)[end]);
            }
            for axis in 1..3 {
                let walls = lattice.at_walls(lattice.voxel(row * nx), axis);
                for (end, wall) in walls.into_iter().enumerate() {
                    at_walls[2 * axis + end] += if wall { inside } else { 0 };
                }
            }
        }
        self.limb_mm3 = self.limb_voxels as f64 * lattice.voxel_mm3;
        (self.low, self.high) = (low, high);
        self.cut_faces = ["-i", "+i", "-j", "+j", "-k", "+k"]
            .into_iter()
            .zip(at_walls)
            .enumerate()
            .filter(|(_, (_, voxels))| *voxels > 0)
            .map(|(at, (face, voxels))| CutFace {
                face: face.to_owned(),
                area_mm2: voxels as f64 * lattice.face_mm2[at / 2],
            })
            .collect();
    }
}
