//! Choice of the limb among the bodies in a scan.

use nalgebra::{Point3, Vector3};
use ppa_ct::Grid;

use super::bodies::Bodies;
use super::lattice::Lattice;
use super::tissue::{TISSUE, Tissue};
use super::{LimbError, LimbSettings};

/// A body weighs half as much when the side faces cut it through about half its size.
const SIDE_CUT_WEIGHT: f64 = 2.0;
/// Bodies with at least this fraction of the largest weight also count as limbs: a foot weighs as much as
/// the other one, a few toes in the corner of the image do not.
const ALIKE: f64 = 0.4;

/// Two limbs lie side by side along a direction when it points from one to the other within 60 degrees; parts
/// of one limb do not.
const SIDE_BY_SIDE: f64 = 0.5;

/// The body around the given point; without one, the heaviest or, of similarly heavy bodies next to it in that direction, the farthest.
pub fn body(
    grid: &Grid,
    tissue: &Tissue,
    found: &Bodies,
    settings: &LimbSettings,
) -> Result<u32, LimbError> {
    if let Some(point) = settings.inside {
        return body_at(grid, tissue, found, point).ok_or(LimbError::Inside(point));
    }
    let lattice = &tissue.lattice;
    let weights = weights(lattice, found);
    let order = |a: &usize, b: &usize| weights[*a].total_cmp(&weights[*b]).then(b.cmp(a));
    let heaviest = (0..weights.len()).max_by(order).unwrap_or_default();
    let Some(towards) = settings.towards else {
        return Ok(heaviest as u32);
    };
    let towards = Vector3::from(towards).normalize();
    let from_heaviest = |body: usize| {
        found.basins[body].centre(lattice, grid) - found.basins[heaviest].centre(lattice, grid)
    };
    let beside = alike(lattice, found)
        .into_iter()
        .enumerate()
        .filter(|(_, alike)| *alike)
        .map(|(body, _)| (body, from_heaviest(body)))
        .filter(|(_, offset)| offset.dot(&towards) >= SIDE_BY_SIDE * offset.norm());
    let farthest = beside.max_by(|(_, a), (_, b)| a.dot(&towards).total_cmp(&b.dot(&towards)));
    Ok(farthest.map_or(heaviest, |(body, _)| body) as u32)
}

/// A further body that is kept as a part of the limb.
pub struct Kept {
    pub body: u32,
    /// The given points in it.
    pub points: Vec<[f64; 3]>,
}

/// The bodies around the further given points; points in the limb itself have no effect.
pub fn kept(
    grid: &Grid,
    tissue: &Tissue,
    found: &Bodies,
    points: &[[f64; 3]],
    chosen: u32,
) -> Result<Vec<Kept>, LimbError> {
    let mut kept: Vec<Kept> = Vec::new();
    for &point in points {
        let body = body_at(grid, tissue, found, point).ok_or(LimbError::Kept(point))?;
        match kept.iter_mut().find(|kept| kept.body == body) {
            Some(kept) => kept.points.push(point),
            None if body == chosen => {}
            None => kept.push(Kept {
                body,
                points: vec![point],
            }),
        }
    }
    Ok(kept)
}

/// Adds the body around a point to `kept`, or removes it from there. `is_near` returns whether a voxel is close enough to its body to belong to it.
pub fn toggle(
    grid: &Grid,
    tissue: &Tissue,
    found: &Bodies,
    kept: &mut Vec<Kept>,
    point: [f64; 3],
    chosen: u32,
    is_near: impl Fn(usize) -> bool,
) -> Result<(), LimbError> {
    let at = tissue_at(grid, tissue, point).ok_or(LimbError::Kept(point))?;
    if !is_near(at) {
        return Err(LimbError::Thin(point));
    }
    let body = found.labels[at];
    if body == chosen {
        return Err(LimbError::InLimb(point));
    }
    match kept.iter().position(|kept| kept.body == body) {
        Some(place) => {
            kept.remove(place);
        }
        None => kept.push(Kept {
            body,
            points: vec![point],
        }),
    }
    Ok(())
}

/// Whether each body is heavy enough to be a limb, compared with the heaviest.
pub fn alike(lattice: &Lattice, found: &Bodies) -> Vec<bool> {
    let weights = weights(lattice, found);
    let heaviest = weights.iter().copied().fold(0.0, f64::max);
    weights
        .iter()
        .map(|weight| *weight >= ALIKE * heaviest)
        .collect()
}

/// Voxels of bone (all voxels if there is no bone), with less weight for bodies cut by side faces.
fn weights(lattice: &Lattice, found: &Bodies) -> Vec<f64> {
    let any_bone = found.basins.iter().any(|b| b.bone_voxels > 0);
    let weight = found.basins.iter().map(|basin| {
        let voxels = match any_bone {
            true => basin.bone_voxels,
            false => basin.voxels,
        };
        let size_mm2 = (basin.voxels as f64 * lattice.voxel_mm3).powf(2.0 / 3.0);
        voxels as f64 / (1.0 + SIDE_CUT_WEIGHT * basin.side_cut_mm2 / size_mm2)
    });
    weight.collect()
}

fn body_at(grid: &Grid, tissue: &Tissue, found: &Bodies, point: [f64; 3]) -> Option<u32> {
    tissue_at(grid, tissue, point).map(|at| found.labels[at])
}

/// The voxel of the box around a point, if it is tissue.
fn tissue_at(grid: &Grid, tissue: &Tissue, point: [f64; 3]) -> Option<usize> {
    let lattice = &tissue.lattice;
    let voxel = grid.voxel_from_ct() * Point3::from(point);
    let place = [0, 1, 2].map(|x| voxel[x].round() - lattice.low[x] as f64);
    if !(0..3).all(|x| (0.0..lattice.size[x] as f64).contains(&place[x])) {
        return None;
    }
    let strides = lattice.strides();
    let at = (0..3).map(|x| place[x] as usize * strides[x]).sum();
    tissue.is(at, TISSUE).then_some(at)
}
