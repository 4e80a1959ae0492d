//! The limb in a scan: its skin surface and the voxels inside, without couch, sheets and neighbours.
//!
//! In order: balls set by the user become air; tissue is what exceeds the skin's HU; the couch is removed by its shape, which does not
//! change along the scan axis; cavities enclosed by solid flesh (air, marrow) count as flesh; an erosion that
//! sheets do not survive leaves solid bodies of denser tissue, which are separated where they
//! only touch; the limb is the body with the most bone; its skin is grown back to the tissue border,
//! but not along anything that merely touches it; air enclosed by it belongs to it; connectivity and DBSCAN keep one piece of the surface.

mod balls;
mod bodies;
mod choice;
mod cleaned;
mod contact;
mod couch;
mod distance;
mod growth;
mod lattice;
mod pieces;
mod report;
mod settings;
mod tissue;
mod walls;

use nalgebra::Vector3;
use ppa_ct::{Grid, Values, Volume, VolumeError};

use crate::dbscan::dbscan;
use crate::mesh::Mesh;
use crate::surface::{SurfaceError, surface_of_part};
use bodies::{NO_BODY, bodies};
use cleaned::cleaned;
use contact::{Touching, smooth_contacts};
use couch::couch_columns;
use distance::{FAR_MM2, spread};
use growth::{farthest_sq, fill_enclosed, grown_back, keep_largest, keep_largest_of};
use lattice::Lattice;
pub use report::{Body, CutFace, LimbReport};
pub use settings::{Ball, LimbSettings, VoxelBox};
use tissue::{ENCLOSED, Tissue};
pub use walls::{CutWalls, WallMeasure};

/// Sample type in which a volume stores Hounsfield units.
trait Hu: Copy + Into<f32> + Send + Sync {}
impl Hu for i16 {}
impl Hu for f32 {}

/// A limb found in a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct Limb {
    /// Skin in the `ct` frame with outward normals; open where a face of the volume cuts the limb.
    pub mesh: Mesh,
    /// Walls that close these openings, stored separately: they are not skin, and a limb does not rest on them.
    pub walls: CutWalls,
    /// Whether each voxel of the volume belongs to the limb, interior included; grid order.
    pub mask: Vec<bool>,
    /// Report of what was found and cut.
    pub report: LimbReport,
}

/// Why no limb was found.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LimbError {
    /// The crop box leaves the volume or is empty.
    #[error(
        "the crop from voxel ({}, {}, {}) to ({}, {}, {}) does not fit into a volume of {} x {} x {} voxels",
        crop.low[0], crop.low[1], crop.low[2], crop.high[0], crop.high[1], crop.high[2], size[0], size[1], size[2]
    )]
    Crop {
        /// Requested box.
        crop: VoxelBox,
        /// Size of the volume, voxels.
        size: [usize; 3],
        /// Error of the volume.
        source: VolumeError,
    },
    /// A setting is out of range.
    #[error("{name} is {value}; it must be {expected}")]
    Setting {
        /// Field of [`LimbSettings`].
        name: &'static str,
        /// Value found.
        value: f64,
        /// Allowed values.
        expected: &'static str,
    },
    /// There is not enough memory for the volume.
    #[error("cannot search for the limb")]
    Memory(#[source] VolumeError),
    /// The volume contains nothing solid.
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
    #[error("the point ({}, {}, {}) mm, given as inside the limb, is not in solid tissue of the volume", .0[0], .0[1], .0[2])]
    Inside([f64; 3]),
    /// A point of a body that is to be kept lies outside the volume or in air.
    #[error("the point ({}, {}, {}) mm of a body to keep is not in solid tissue of the volume", .0[0], .0[1], .0[2])]
    Kept([f64; 3]),
    /// A point of a structure that is not a body because it is thinner than twice [`LimbSettings::core_radius_mm`].
    #[error("the point ({}, {}, {}) mm is not inside a body: sheets and other thin structures cannot be kept", .0[0], .0[1], .0[2])]
    Thin([f64; 3]),
    /// The body to keep or to remove is the limb.
    #[error("the point ({}, {}, {}) mm is in the limb itself, which is always kept; another body can be chosen as the limb", .0[0], .0[1], .0[2])]
    InLimb([f64; 3]),
    /// No surface could be made.
    #[error("the limb has no surface")]
    Surface(#[from] SurfaceError),
}

/// Working memory per voxel, bytes: 5.4 times a 16-bit voxel if a limb fills the scan, plus the mask.
const WORKING_BYTES: usize = 12;
/// Largest additional memory per voxel if something is cut off, bytes.
const BYTES_OF_COPY: usize = 4;

/// Finds the limb of a scan.
///
/// The mesh is open where the volume (or the crop) cuts the limb, since a wall there is not skin; the walls
/// are returned separately. The mask shows what to keep when everything else is to be blanked to air.
///
/// Where two limbs are pressed together, HU do not show whose skin is whose: there the border is found by
/// depth, in a scan of two hands up to 4 voxels from where an eye puts it. A hollow that the end of the
/// scan cuts open is not filled. Working memory depends on the box around all tissue: as much as the scan's 16-bit voxels if a limb is in
/// the middle of it, over four times as much if limbs fill it.
///
/// # Errors
/// [`LimbError`] if the settings do not fit, memory does not suffice or nothing solid is found.
pub fn extract_limb(volume: &Volume, settings: &LimbSettings) -> Result<Limb, LimbError> {
    extract(volume, settings, None)
}

/// The same as [`extract_limb`], with the body around `point` (`ct` frame, mm) kept as a part of the limb, or removed if it is kept. Also
/// returns the resulting points of [`LimbSettings::kept`].
///
/// # Errors
/// The same as [`extract_limb`]; [`LimbError::Kept`] for a point in air, [`LimbError::Thin`] in a sheet, [`LimbError::InLimb`] in the limb.
pub fn toggle_body(
    volume: &Volume,
    settings: &LimbSettings,
    point: [f64; 3],
) -> Result<(Limb, Vec<[f64; 3]>), LimbError> {
    let limb = extract(volume, settings, Some(point))?;
    let mut points = settings.kept.clone();
    points.push(point);
    let is_kept = |point: &[f64; 3]| limb.report.bodies.iter().any(|b| b.kept.contains(point));
    points.retain(is_kept);
    Ok((limb, points))
}

fn extract(
    volume: &Volume,
    settings: &LimbSettings,
    toggled: Option<[f64; 3]>,
) -> Result<Limb, LimbError> {
    check(settings)?;
    volume
        .expect_room(WORKING_BYTES)
        .map_err(LimbError::Memory)?;
    let Some(crop) = settings.crop else {
        return within(volume, settings, toggled);
    };
    let size = volume.grid().size();
    let part = volume
        .crop(crop.low, crop.high)
        .map_err(|source| LimbError::Crop { crop, size, source })?;
    let mut limb = within(&part, settings, toggled)?;
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
    let hu = [
        ("iso_hu", settings.iso_hu),
        ("bone_hu", settings.bone_hu),
        ("core_hu", settings.core_hu),
    ];
    for (name, value) in hu {
        if !(-1024.0..=32_768.0).contains(&value) {
            return Err(LimbError::Setting {
                name,
                value,
                expected: "a CT number between -1024 and 32768 HU",
            });
        }
    }
    if let Some(towards) = settings.towards {
        let length = Vector3::from(towards).norm();
        if !(length > 0.0 && length.is_finite()) {
            return Err(LimbError::Setting {
                name: "towards",
                value: length,
                expected: "a direction of length above 0",
            });
        }
    }
    balls::check(&settings.removed)?;
    if settings.core_hu < settings.iso_hu {
        return Err(LimbError::Setting {
            name: "core_hu",
            value: settings.core_hu,
            expected: "at least iso_hu",
        });
    }
    Ok(())
}

fn within(
    volume: &Volume,
    settings: &LimbSettings,
    toggled: Option<[f64; 3]>,
) -> Result<Limb, LimbError> {
    if settings.removed.is_empty() {
        return searched(volume, settings, toggled);
    }
    volume
        .expect_room(WORKING_BYTES + BYTES_OF_COPY)
        .map_err(LimbError::Memory)?;
    let emptied = balls::without(volume, &settings.removed, settings.iso_hu);
    let (emptied, removed_mm3) = emptied.map_err(LimbError::Memory)?;
    let mut limb = searched(&emptied, settings, toggled)?;
    limb.report.removed_mm3 = removed_mm3;
    Ok(limb)
}

fn searched(
    volume: &Volume,
    settings: &LimbSettings,
    toggled: Option<[f64; 3]>,
) -> Result<Limb, LimbError> {
    match volume.values() {
        Values::I16(hu) => within_values(volume.grid(), hu, settings, toggled),
        Values::F32(hu) => within_values(volume.grid(), hu, settings, toggled),
    }
}

fn within_values<T: Hu>(
    grid: &Grid,
    hu: &[T],
    settings: &LimbSettings,
    toggled: Option<[f64; 3]>,
) -> Result<Limb, LimbError> {
    if grid.size().contains(&1) {
        return Err(SurfaceError::TooThin(grid.size()).into());
    }
    let (whole, iso) = (Lattice::of(grid), settings.iso_hu as f32);
    let mut report = LimbReport::default();
    let nothing_solid = || LimbError::NothingSolid {
        core_hu: settings.core_hu,
        thickness_mm: 2.0 * settings.core_radius_mm,
        max_hu: hu.iter().map(|&v| v.into()).fold(f32::MIN, f32::max),
    };
    let (persistence, thickness_mm) = (settings.couch_persistence, settings.couch_thickness_mm);
    let columns = couch_columns(&whole, hu, iso, persistence, thickness_mm);
    report.couch_columns = count(&columns.couch);
    report.couch_voxels = columns.couch_voxels();
    let mut tissue = Tissue::find(&whole, hu, &columns, settings).ok_or_else(nothing_solid)?;
    tissue.fill_enclosed();
    let lattice = &tissue.lattice;

    let mut found = bodies(&tissue, settings.core_radius_mm, settings.neck_ratio);
    if found.basins.is_empty() {
        return Err(nothing_solid());
    }
    // From here on the labels say to which body each voxel is nearest. How far tissue lies from the
    // bodies matters only near them, but a point given may be anywhere.
    let mut reach_sq: Vec<f32> = found.labels.iter().map(from_body).collect();
    let farthest_sq = farthest_sq(settings.core_radius_mm);
    let is_automatic = settings.inside.is_none() && settings.kept.is_empty() && toggled.is_none();
    let limit_sq = is_automatic.then_some(farthest_sq);
    let points_inside = found.points_inside(lattice, grid);
    let (size, spacing_mm) = (lattice.size, lattice.spacing_mm);
    spread(size, spacing_mm, &mut reach_sq, &mut found.labels, limit_sq);
    let chosen = choice::body(grid, &tissue, &found, settings)?;
    let mut kept = choice::kept(grid, &tissue, &found, &settings.kept, chosen)?;
    if let Some(point) = toggled {
        let is_near = |at: usize| reach_sq[at] <= farthest_sq;
        choice::toggle(grid, &tissue, &found, &mut kept, point, chosen, is_near)?;
    }
    report.describe_bodies(grid, lattice, &found, &points_inside, chosen, &kept);
    let mut of_limb = vec![chosen];
    of_limb.extend(kept.iter().map(|kept| kept.body));

    let grown = grown_back(&tissue, &reach_sq, settings.core_radius_mm);
    drop(reach_sq);
    let mut inside: Vec<bool> = std::iter::zip(&grown, &found.labels)
        .map(|(grown, body)| *grown && of_limb.contains(body))
        .collect();
    // Bodies that are kept need not be connected with the limb.
    let labels = (of_limb.len() > 1).then_some(found.labels);
    smooth_contacts(lattice, &grown, &mut inside);
    report.describe_contact(grid, lattice, Touching::of(lattice, &grown, &inside));
    drop(grown);
    let (islands, parts) = match labels {
        None => (keep_largest(lattice, &mut inside), 1),
        Some(labels) => keep_largest_of(lattice, &mut inside, &labels, &of_limb),
    };
    report.island_voxels = islands;
    let tissue_voxels = columns.tissue.iter().map(|&n| n as usize).sum::<usize>();
    let limb_tissue = |at: &usize| inside[*at] && !tissue.is(*at, ENCLOSED);
    let limb_tissue = (0..inside.len()).filter(limb_tissue).count();
    report.other_voxels = tissue_voxels - report.couch_voxels - limb_tissue;
    report.interior_voxels = count(&inside) - limb_tissue + fill_enclosed(lattice, &mut inside);
    report.describe_limb(lattice, &inside);

    let mut mask = vec![false; whole.len()];
    for (row, inside) in inside.chunks(size[0]).enumerate() {
        let [_, j, k] = lattice.voxel(row * size[0]);
        let start = grid.index([0, lattice.low[1] + j, lattice.low[2] + k]) + lattice.low[0];
        mask[start..start + size[0]].copy_from_slice(inside);
    }
    drop((inside, tissue));
    // One voxel beyond the limb for the surface, another one for its normals.
    let part = whole.window_around(report.low, report.high, 2);
    let values = cleaned(&part, hu, &mask, iso);
    let surface = surface_of_part(grid, part.low, part.size, &values, iso)?;
    let mesh = largest_pieces(&surface, settings, parts, &mut report);
    let walls = CutWalls::of(grid, &mesh);
    Ok(Limb {
        mesh,
        walls,
        mask,
        report,
    })
}

fn count(mask: &[bool]) -> usize {
    mask.iter().filter(|m| **m).count()
}

fn from_body(label: &u32) -> f32 {
    if *label == NO_BODY { FAR_MM2 } else { 0.0 }
}

/// The largest connected piece of the main cluster of surface points; for a limb of several `parts`, that number of largest pieces.
fn largest_pieces(
    surface: &Mesh,
    settings: &LimbSettings,
    parts: usize,
    report: &mut LimbReport,
) -> Mesh {
    let clusters = dbscan(
        &surface.vertices,
        settings.dbscan_eps_mm,
        settings.dbscan_min_points,
    );
    report.clusters = clusters.sizes.len();
    let pieces = surface.vertex_components();
    let main = (0..clusters.sizes.len()).max_by_key(|&c| (clusters.sizes[c], usize::MAX - c));
    let mut in_main = vec![0_usize; pieces.len()];
    for (&piece, label) in pieces.iter().zip(&clusters.labels) {
        if label.map(|c| c as usize) == main {
            in_main[piece as usize] += 1;
        }
    }
    let mut order: Vec<usize> = (0..in_main.len()).collect();
    if parts > 1 {
        // Separate parts are clusters of their own.
        in_main.fill(0);
        pieces
            .iter()
            .for_each(|&piece| in_main[piece as usize] += 1);
    }
    order.sort_by_key(|&p| (usize::MAX - in_main[p], p));
    order.truncate(parts);
    let keep = |vertex: u32| order.contains(&(pieces[vertex as usize] as usize));
    let mesh = surface.restricted(keep);
    report.points = mesh.vertices.len();
    report.points_removed = surface.vertices.len() - mesh.vertices.len();
    mesh
}
