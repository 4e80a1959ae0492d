//! Solid bodies in a volume, told apart where they only touch.

use super::lattice::Lattice;

/// Depths that differ by less than this are treated alike, mm.
const DEPTH_STEP_MM: f64 = 0.1;

/// One body: what the watershed gathered around a depth maximum.
#[derive(Debug, Clone, Default)]
pub struct Basin {
    /// Largest depth below the body's surface, mm.
    pub peak_mm: f64,
    pub voxels: usize,
    pub bone_voxels: usize,
    /// Area in the side faces of the volume, mm².
    pub side_cut_mm2: f64,
    /// Sum of voxel indices, for the centre.
    pub index_sum: [f64; 3],
}

/// Bodies and the body of each voxel (`u32::MAX`: not deep enough).
pub struct Bodies {
    pub labels: Vec<u32>,
    pub basins: Vec<Basin>,
}

/// Watershed of the depth map from the deepest voxels outward.
///
/// Two basins that meet become one body unless the place where they meet is a neck: less than
/// `neck_ratio` as deep as the shallower of both. A calf and its foot become one, two
/// calves that touch stay two.
pub fn bodies(
    lattice: &Lattice,
    depth_sq: &[f32],
    bone: &dyn Fn(usize) -> bool,
    least_depth_mm: f64,
    neck_ratio: f64,
) -> Bodies {
    let depth = |at: usize| f64::from(depth_sq[at]).sqrt();
    let mut parent: Vec<u32> = Vec::new();
    let mut basins: Vec<Basin> = Vec::new();
    let mut labels = vec![u32::MAX; depth_sq.len()];
    for at in deepest_first(depth_sq, least_depth_mm) {
        let here = depth(at);
        let mut main: Option<u32> = None;
        for neighbour in lattice.neighbours(at) {
            if labels[neighbour] == u32::MAX {
                continue;
            }
            let other = crate::topology::root(&mut parent, labels[neighbour]);
            main = Some(match main {
                None => other,
                Some(main) if main == other => main,
                Some(main) => {
                    let peak = |b: u32| basins[b as usize].peak_mm;
                    let (higher, lower) = if peak(main) >= peak(other) {
                        (main, other)
                    } else {
                        (other, main)
                    };
                    if here >= neck_ratio * peak(lower) {
                        merge(&mut parent, &mut basins, higher, lower)
                    } else {
                        higher
                    }
                }
            });
        }
        let label = main.unwrap_or_else(|| {
            basins.push(Basin {
                peak_mm: here,
                ..Basin::default()
            });
            parent.push(parent.len() as u32);
            parent.len() as u32 - 1
        });
        labels[at] = label;
        let basin = &mut basins[label as usize];
        let voxel = lattice.voxel(at);
        basin.voxels += 1;
        basin.bone_voxels += usize::from(bone(at));
        for (axis, &place) in voxel.iter().enumerate() {
            basin.index_sum[axis] += place as f64;
            let border = place == 0 || place + 1 == lattice.size[axis];
            if axis != lattice.scan_axis && border {
                basin.side_cut_mm2 += lattice.voxel_mm3() / lattice.spacing_mm[axis];
            }
        }
    }
    compact(labels, &mut parent, &basins)
}

fn merge(parent: &mut [u32], basins: &mut [Basin], higher: u32, lower: u32) -> u32 {
    let (keep, gone) = (higher.min(lower), higher.max(lower));
    parent[gone as usize] = keep;
    let other = std::mem::take(&mut basins[gone as usize]);
    let basin = &mut basins[keep as usize];
    basin.peak_mm = basin.peak_mm.max(other.peak_mm);
    basin.voxels += other.voxels;
    basin.bone_voxels += other.bone_voxels;
    basin.side_cut_mm2 += other.side_cut_mm2;
    for axis in 0..3 {
        basin.index_sum[axis] += other.index_sum[axis];
    }
    keep
}

/// Voxels at least that deep, deepest first, equal ones in memory order (counting sort).
fn deepest_first(depth_sq: &[f32], least_depth_mm: f64) -> Vec<usize> {
    let step = |squared: f32| (f64::from(squared).sqrt() / DEPTH_STEP_MM).min(1e5) as usize;
    let least_sq = (least_depth_mm * least_depth_mm) as f32;
    let deep = |at: &usize| depth_sq[*at] >= least_sq;
    let steps: Vec<u32> = depth_sq
        .iter()
        .map(|&squared| step(squared) as u32)
        .collect();
    let last = steps.iter().copied().max().unwrap_or(0);
    let mut starts = vec![0_usize; last as usize + 2];
    for at in (0..depth_sq.len()).filter(deep) {
        starts[(last - steps[at]) as usize + 1] += 1;
    }
    for bin in 1..starts.len() {
        starts[bin] += starts[bin - 1];
    }
    let mut order = vec![0; starts[last as usize + 1]];
    for at in (0..depth_sq.len()).filter(deep) {
        let slot = &mut starts[(last - steps[at]) as usize];
        order[*slot] = at;
        *slot += 1;
    }
    order
}

fn compact(mut labels: Vec<u32>, parent: &mut [u32], basins: &[Basin]) -> Bodies {
    let mut numbers = vec![u32::MAX; basins.len()];
    let mut kept = Vec::new();
    for basin in 0..basins.len() {
        if parent[basin] as usize == basin {
            numbers[basin] = kept.len() as u32;
            kept.push(basins[basin].clone());
        }
    }
    for label in labels.iter_mut().filter(|label| **label != u32::MAX) {
        *label = numbers[crate::topology::root(parent, *label) as usize];
    }
    Bodies {
        labels,
        basins: kept,
    }
}
