//! Growth of the core of a body back to its skin.

use super::lattice::Lattice;
use super::pieces::Pieces;
use super::tissue::{TISSUE, Tissue};

/// Largest height of skin relief above the grown-back core, mm; tissue that continues beyond it only
/// touches the limb.
const RELIEF_MM: f64 = 4.0;

/// Squared distance from the core beyond which nothing belongs to a body, mm².
pub fn farthest_sq(radius_mm: f64) -> f32 {
    (radius_mm + RELIEF_MM).powi(2) as f32
}

/// Tissue within the erosion radius of the core, and the skin relief on top of it.
///
/// Tissue farther out forms connected pieces: a piece that stays near is relief removed by the
/// erosion, one that reaches far (a sheet, an electrode) only touches the limb.
pub fn grown_back(tissue: &Tissue, reach_sq: &[f32], radius_mm: f64) -> Vec<bool> {
    let lattice = &tissue.lattice;
    // The core is counted from voxel centre to voxel centre; its border lies half a voxel out.
    let least = |a: f64, b: &f64| a.min(*b);
    let half_voxel = 0.5 * lattice.spacing_mm.iter().fold(f64::INFINITY, least);
    let near_sq = (radius_mm + half_voxel).powi(2) as f32;
    let pieces = Pieces::of(lattice, |at| {
        tissue.is(at, TISSUE) && reach_sq[at] > near_sq
    });
    let mut piece_sq = vec![0.0_f32; pieces.count];
    for (piece, run) in pieces.runs() {
        piece_sq[piece] = reach_sq[run]
            .iter()
            .copied()
            .fold(piece_sq[piece], f32::max);
    }
    let mut mask: Vec<bool> = (0..lattice.len())
        .map(|at| tissue.is(at, TISSUE) && reach_sq[at] <= near_sq)
        .collect();
    for (piece, run) in pieces.runs() {
        mask[run].fill(piece_sq[piece] <= farthest_sq(radius_mm));
    }
    mask
}

/// Removes all but the largest piece and returns the number of removed voxels.
pub fn keep_largest(lattice: &Lattice, mask: &mut [bool]) -> usize {
    let pieces = Pieces::of(lattice, |at| mask[at]);
    let sizes = pieces.sizes();
    let largest = (0..sizes.len()).max_by_key(|&at| (sizes[at], usize::MAX - at));
    let mut removed = 0;
    for (piece, run) in pieces.runs() {
        if Some(piece) != largest {
            removed += run.len();
            mask[run].fill(false);
        }
    }
    removed
}

/// The same as [`keep_largest`] for a limb of several bodies: keeps the piece with the most voxels of each body.
/// `labels` gives the body of each voxel. Returns the numbers of removed voxels and of remaining pieces.
pub fn keep_largest_of(
    lattice: &Lattice,
    mask: &mut [bool],
    labels: &[u32],
    bodies: &[u32],
) -> (usize, usize) {
    let pieces = Pieces::of(lattice, |at| mask[at]);
    let mut sizes = vec![vec![0_usize; pieces.count]; bodies.len()];
    for (piece, run) in pieces.runs() {
        for label in &labels[run] {
            if let Some(body) = bodies.iter().position(|body| body == label) {
                sizes[body][piece] += 1;
            }
        }
    }
    let mut stays = vec![false; pieces.count];
    for sizes in &sizes {
        let largest = (0..sizes.len()).max_by_key(|&at| (sizes[at], usize::MAX - at));
        if let Some(piece) = largest.filter(|&piece| sizes[piece] > 0) {
            stays[piece] = true;
        }
    }
    let mut removed = 0;
    for (piece, run) in pieces.runs() {
        if !stays[piece] {
            removed += run.len();
            mask[run].fill(false);
        }
    }
    (removed, stays.into_iter().filter(|stays| *stays).count())
}

/// Adds the voxels that no path outside the mask connects with the border of the box, and returns
/// their number.
pub fn fill_enclosed(lattice: &Lattice, mask: &mut [bool]) -> usize {
    let pieces = Pieces::of(lattice, |at| !mask[at]);
    let mut added = 0;
    for (_, run) in pieces.enclosed(lattice).filter(|(enclosed, _)| *enclosed) {
        added += run.len();
        mask[run].fill(true);
    }
    added
}
