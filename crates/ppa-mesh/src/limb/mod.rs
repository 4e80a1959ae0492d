//! The limb in a scan: its skin surface and the voxels inside, without couch, sheets and neighbours.
//!
//! In order: tissue is what exceeds the skin's HU; the couch is removed by its shape, which does not
//! change along the scan axis; solid bodies are what remains of denser tissue after an erosion that
//! sheets do not survive, told apart where they only touch; the limb is the body that holds most
//! bone; its skin is grown back to the tissue border, but not along what merely touches it; air
//! enclosed by it belongs to it; and of the surface of that, connectivity and DBSCAN keep one piece.

mod bodies;
mod cleaned;
mod couch;
mod distance;
mod lattice;
mod report;
mod settings;

use nalgebra::Point3;
use ppa_ct::{Volume, VolumeError};

use crate::dbscan::dbscan;
use crate::mesh::Mesh;
use crate::surface::{Border, SurfaceError, iso_surface};
use bodies::{Bodies, bodies};
use cleaned::cleaned;
use couch::couch_columns;
use distance::nearest;
use lattice::Lattice;
pub use report::{Body, CutFace, LimbReport};
pub use settings::{LimbSettings, VoxelBox};

/// Tissue beyond the grown-back core is skin relief up to this far, and something that touches the
/// limb where it goes on, mm.
const RELIEF_MM: f64 = 4.0;
/// A body weighs half as much when the side faces cut it through about half its size.
const SIDE_CUT_WEIGHT: f64 = 2.0;
/// At most this many surface points are clustered; more are thinned evenly first.
const MAX_CLUSTER_POINTS: usize = 20_000;

/// A limb found in a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct Limb {
    /// Skin in the `ct` frame with outward normals; open where a face of the volume cuts the limb.
    pub mesh: Mesh,
    /// Whether each voxel of the volume belongs to the limb, interior included; grid order.
    pub mask: Vec<bool>,
    /// What was found and cut.
    pub report: LimbReport,
}

/// Why no limb was found.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LimbError {
    /// The crop box leaves the volume or is empty.
    #[error("the crop {crop:?} does not fit into a volume of {size:?} voxels")]
    Crop {
        /// Box asked for.
        crop: VoxelBox,
        /// Voxels there are.
        size: [usize; 3],
        /// What the volume said.
        source: VolumeError,
    },
    /// A setting is out of range.
    #[error("{name} is {value}; it must be {expected}")]
    Setting {
        /// Field of [`LimbSettings`].
        name: &'static str,
        /// Value found.
        value: f64,
        /// What would do.
        expected: &'static str,
    },
    /// Nothing solid is in the volume.
    #[error(
        "no limb: nothing above {core_hu} HU is thicker than {thickness_mm} mm (values reach {max_hu} HU)"
    )]
    NothingSolid {
        /// HU of solid tissue.
        core_hu: f64,
        /// Least thickness of a limb, mm.
        thickness_mm: f64,
        /// Largest value of the volume.
        max_hu: f32,
    },
    /// The chosen point lies outside the volume or in air.
    #[error("the point {0:?} mm, said to be inside the limb, is not in solid tissue of the volume")]
    Inside([f64; 3]),
    /// No surface could be made.
    #[error("the limb has no surface")]
    Surface(#[from] SurfaceError),
}

/// Finds the limb of a scan.
///
/// The mesh is open where the volume (or the crop) cuts the limb: a lid would be seen by a depth
/// camera as skin. The mask says what to keep when everything else is to be blanked to air.
///
/// # Errors
/// [`LimbError`] when the settings do not fit or nothing solid is there.
pub fn extract_limb(volume: &Volume, settings: &LimbSettings) -> Result<Limb, LimbError> {
    check(settings)?;
    let Some(crop) = settings.crop else {
        return within(volume, settings);
    };
    let size = volume.grid().size();
    let part = volume
        .crop(crop.low, crop.high)
        .map_err(|source| LimbError::Crop { crop, size, source })?;
    let mut limb = within(&part, settings)?;
    let mut mask = vec![false; volume.grid().len()];
    for (at, _) in limb.mask.iter().enumerate().filter(|(_, m)| **m) {
        let voxel = part.grid().voxel(at);
        mask[volume
            .grid()
            .index([0, 1, 2].map(|x| voxel[x] + crop.low[x]))] = true;
    }
    limb.mask = mask;
    for corner in [&mut limb.report.low, &mut limb.report.high] {
        *corner = [0, 1, 2].map(|x| corner[x] + crop.low[x]);
    }
    Ok(limb)
}

fn check(settings: &LimbSettings) -> Result<(), LimbError> {
    let positive = [
        ("core_radius_mm", settings.core_radius_mm),
        ("neck_ratio", settings.neck_ratio),
        ("couch_persistence", settings.couch_persistence),
        ("couch_thickness_mm", settings.couch_thickness_mm),
        ("dbscan_eps_mm", settings.dbscan_eps_mm),
    ];
    for (name, value) in positive {
        if !(value > 0.0 && value.is_finite()) {
            return Err(LimbError::Setting {
                name,
                value,
                expected: "positive",
            });
        }
    }
    if settings.core_hu < settings.iso_hu {
        return Err(LimbError::Setting {
            name: "core_hu",
            value: settings.core_hu,
            expected: "at least iso_hu",
        });
    }
    Ok(())
}

fn within(volume: &Volume, settings: &LimbSettings) -> Result<Limb, LimbError> {
    let lattice = Lattice::of(volume.grid());
    let hu = volume.hu();
    let (iso, core_hu) = (settings.iso_hu as f32, settings.core_hu as f32);
    let mut report = LimbReport::default();
    let mut tissue: Vec<bool> = hu.iter().map(|&v| v >= iso).collect();
    let tissue_voxels = count(&tissue);

    let couch = couch_columns(
        &lattice,
        &tissue,
        settings.couch_persistence,
        settings.couch_thickness_mm,
    );
    report.couch_columns = count(&couch);
    if report.couch_columns > 0 {
        for at in 0..tissue.len() {
            if tissue[at] && couch[lattice.column(at)] {
                tissue[at] = false;
                report.couch_voxels += 1;
            }
        }
    }

    let hollow: Vec<bool> = (0..hu.len())
        .map(|at| !(tissue[at] && hu[at] >= core_hu))
        .collect();
    let (depth_sq, _) = nearest(lattice.size, lattice.spacing_mm, &hollow);
    drop(hollow);
    let found = bodies(
        &lattice,
        &depth_sq,
        &|at| hu[at] >= settings.bone_hu as f32,
        settings.core_radius_mm,
        settings.neck_ratio,
    );
    drop(depth_sq);
    if found.basins.is_empty() {
        return Err(LimbError::NothingSolid {
            core_hu: settings.core_hu,
            thickness_mm: 2.0 * settings.core_radius_mm,
            max_hu: hu.iter().copied().fold(f32::MIN, f32::max),
        });
    }
    let solid: Vec<bool> = found
        .labels
        .iter()
        .map(|&label| label != u32::MAX)
        .collect();
    let (reach_sq, source) = nearest(lattice.size, lattice.spacing_mm, &solid);
    let chosen = match settings.inside {
        Some(point) => body_at(volume, &tissue, &found, &source, point)?,
        None => best_body(&lattice, &found),
    };
    describe_bodies(volume, &lattice, &found, chosen, &mut report);

    let mut mask = grown_back(&lattice, &tissue, &reach_sq, settings.core_radius_mm);
    drop(reach_sq);
    for at in 0..mask.len() {
        mask[at] &= found.labels[source[at] as usize] == chosen;
    }
    drop((source, found));
    report.island_voxels = keep_largest(&lattice, &mut mask);
    report.other_voxels = tissue_voxels - report.couch_voxels - count(&mask);
    let enclosed = lattice.enclosed(&mask);
    for at in 0..mask.len() {
        mask[at] |= enclosed[at];
    }
    report.interior_voxels = count(&enclosed);
    describe_limb(&lattice, &mask, &mut report);

    let surface = iso_surface(&cleaned(volume, &mask, iso), iso, Border::Open)?;
    let mesh = one_piece(&surface, settings, &mut report);
    Ok(Limb { mesh, mask, report })
}

fn count(mask: &[bool]) -> usize {
    mask.iter().filter(|m| **m).count()
}

/// The body with the most bone, those cut by side faces counting less; without bone the largest.
fn best_body(lattice: &Lattice, found: &Bodies) -> u32 {
    let any_bone = found.basins.iter().any(|b| b.bone_voxels > 0);
    let score = |at: usize| {
        let basin = &found.basins[at];
        let amount = if any_bone {
            basin.bone_voxels
        } else {
            basin.voxels
        } as f64;
        let size_mm2 = (basin.voxels as f64 * lattice.voxel_mm3()).powf(2.0 / 3.0);
        amount / (1.0 + SIDE_CUT_WEIGHT * basin.side_cut_mm2 / size_mm2)
    };
    let order = |&a: &usize, &b: &usize| score(a).total_cmp(&score(b)).then(b.cmp(&a));
    (0..found.basins.len()).max_by(order).unwrap_or_default() as u32
}

fn body_at(
    volume: &Volume,
    tissue: &[bool],
    found: &Bodies,
    source: &[u32],
    point: [f64; 3],
) -> Result<u32, LimbError> {
    let grid = volume.grid();
    let voxel = grid.voxel_from_ct() * Point3::from(point);
    let nearest = voxel.coords.map(f64::round);
    let inside = (0..3).all(|x| (0.0..grid.size()[x] as f64).contains(&nearest[x]));
    if !inside {
        return Err(LimbError::Inside(point));
    }
    let at = grid.index([0, 1, 2].map(|x| nearest[x] as usize));
    if !tissue[at] {
        return Err(LimbError::Inside(point));
    }
    Ok(found.labels[source[at] as usize])
}

/// Tissue within the erosion radius of the core, and the skin relief on top of it.
///
/// What lies farther out hangs together in pieces; a piece that stays near is relief that the
/// erosion wore off, one that reaches far (a sheet, an electrode) only touches the limb.
fn grown_back(lattice: &Lattice, tissue: &[bool], reach_sq: &[f32], radius_mm: f64) -> Vec<bool> {
    // The core is counted from voxel centre to voxel centre; its border lies half a voxel out.
    let half_voxel = 0.5
        * lattice
            .spacing_mm
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min);
    let near_sq = (radius_mm + half_voxel).powi(2) as f32;
    let far_sq = (radius_mm + RELIEF_MM).powi(2) as f32;
    let beyond: Vec<bool> = (0..tissue.len())
        .map(|at| tissue[at] && reach_sq[at] > near_sq)
        .collect();
    let pieces = lattice.components(&beyond);
    let mut farthest_sq = vec![0.0_f32; pieces.count];
    for (at, &label) in pieces.labels.iter().enumerate() {
        if let Some(far) = farthest_sq.get_mut(label as usize) {
            *far = far.max(reach_sq[at]);
        }
    }
    (0..tissue.len())
        .map(|at| match pieces.labels[at] {
            u32::MAX => tissue[at] && reach_sq[at] <= near_sq,
            label => farthest_sq[label as usize] <= far_sq,
        })
        .collect()
}

fn keep_largest(lattice: &Lattice, mask: &mut [bool]) -> usize {
    let pieces = lattice.components(mask);
    let mut sizes = vec![0_usize; pieces.count];
    for &label in pieces.labels.iter().filter(|l| **l != u32::MAX) {
        sizes[label as usize] += 1;
    }
    let largest = (0..sizes.len()).max_by_key(|&at| (sizes[at], usize::MAX - at));
    let mut removed = 0;
    for (at, &label) in pieces.labels.iter().enumerate() {
        if label != u32::MAX && Some(label as usize) != largest {
            mask[at] = false;
            removed += 1;
        }
    }
    removed
}

/// The largest connected piece of the main cluster of surface points.
fn one_piece(surface: &Mesh, settings: &LimbSettings, report: &mut LimbReport) -> Mesh {
    let step = surface.vertices.len().div_ceil(MAX_CLUSTER_POINTS).max(1);
    let sample: Vec<usize> = (0..surface.vertices.len()).step_by(step).collect();
    let points: Vec<Point3<f32>> = sample.iter().map(|&v| surface.vertices[v]).collect();
    // A sample is thinner: the radius grows so that as many points lie around each.
    let eps_mm = settings.dbscan_eps_mm * (step as f64).sqrt();
    let clusters = dbscan(&points, eps_mm, settings.dbscan_min_points);
    report.clusters = clusters.sizes.len();
    let pieces = surface.vertex_components();
    let main = (0..clusters.sizes.len()).max_by_key(|&c| (clusters.sizes[c], usize::MAX - c));
    let mut in_main = vec![0_usize; pieces.len()];
    for (&vertex, label) in sample.iter().zip(&clusters.labels) {
        if label.map(|c| c as usize) == main {
            in_main[pieces[vertex] as usize] += 1;
        }
    }
    let kept = (0..in_main.len()).max_by_key(|&p| (in_main[p], usize::MAX - p));
    let keep = |vertex: u32| Some(pieces[vertex as usize] as usize) == kept;
    let mesh = surface.restricted(keep);
    report.points = mesh.vertices.len();
    report.points_removed = surface.vertices.len() - mesh.vertices.len();
    mesh
}

fn describe_bodies(
    volume: &Volume,
    lattice: &Lattice,
    found: &Bodies,
    chosen: u32,
    report: &mut LimbReport,
) {
    report.bodies = found
        .basins
        .iter()
        .enumerate()
        .map(|(at, basin)| Body {
            chosen: at as u32 == chosen,
            core_mm3: basin.voxels as f64 * lattice.voxel_mm3(),
            bone_mm3: basin.bone_voxels as f64 * lattice.voxel_mm3(),
            side_cut_mm2: basin.side_cut_mm2,
            centre_mm: volume
                .grid()
                .centre(basin.index_sum.map(|sum| sum / basin.voxels as f64))
                .into(),
        })
        .collect();
    report.bodies.sort_by(|a, b| {
        b.bone_mm3
            .total_cmp(&a.bone_mm3)
            .then(b.core_mm3.total_cmp(&a.core_mm3))
    });
}

fn describe_limb(lattice: &Lattice, mask: &[bool], report: &mut LimbReport) {
    let mut cut = [0.0; 6];
    let (mut low, mut high) = (lattice.size, [0; 3]);
    for (at, _) in mask.iter().enumerate().filter(|(_, m)| **m) {
        let voxel = lattice.voxel(at);
        for axis in 0..3 {
            low[axis] = low[axis].min(voxel[axis]);
            high[axis] = high[axis].max(voxel[axis] + 1);
            let area = lattice.voxel_mm3() / lattice.spacing_mm[axis];
            if voxel[axis] == 0 {
                cut[2 * axis] += area;
            }
            if voxel[axis] + 1 == lattice.size[axis] {
                cut[2 * axis + 1] += area;
            }
        }
    }
    report.limb_voxels = count(mask);
    report.limb_mm3 = report.limb_voxels as f64 * lattice.voxel_mm3();
    (report.low, report.high) = (low, high);
    report.cut_faces = ["-i", "+i", "-j", "+j", "-k", "+k"]
        .iter()
        .zip(cut)
        .filter(|(_, area)| *area > 0.0)
        .map(|(face, area_mm2)| CutFace {
            face: (*face).to_owned(),
            area_mm2,
        })
        .collect();
}
