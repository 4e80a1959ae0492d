//! Solid bodies in a volume, separated where they only touch.

use nalgebra::Point3;
use ppa_ct::Grid;

use super::distance::squared_distances;
use super::lattice::Lattice;
use super::tissue::{BONE, CORE, Tissue};

/// Depths that differ by less than this are treated alike, mm.
const DEPTH_STEP_MM: f64 = 0.1;

/// One body: the voxels that the watershed gathered around a depth maximum.
#[derive(Debug, Clone, Default)]
pub struct Basin {
    /// Largest depth below the body's surface, mm.
    pub peak_mm: f64,
    pub voxels: usize,
    pub bone_voxels: usize,
    /// Area in the side faces of the volume, mm².
    pub side_cut_mm2: f64,
    /// Sum of voxel indices within the box, for the centre.
    pub index_sum: [f64; 3],
}

/// Label of voxels not deep enough to belong to a body.
pub const NO_BODY: u32 = u32::MAX;

/// Bodies and the body of each voxel of the box ([`NO_BODY`] for none).
pub struct Bodies {
    pub labels: Vec<u32>,
    pub basins: Vec<Basin>,
}

/// Watershed of the depth map from the deepest voxels outward.
///
/// Two basins that meet become one body unless the place where they meet is a neck: less than
/// `neck_ratio` as deep as the shallower of both. A calf and its foot become one, two
/// calves that touch stay two. A voxel of a neck belongs to the body of its deepest neighbour: if it
/// always went to the deeper body, that body would grow around the other, layer by layer.
pub fn bodies(tissue: &Tissue, least_depth_mm: f64, neck_ratio: f64) -> Bodies {
    let lattice = &tissue.lattice;
    let hollow = |at: usize| !tissue.is(at, CORE);
    let depth_sq = squared_distances(lattice.size, lattice.spacing_mm, hollow);
    let strides = lattice.strides();
    let mut parent: Vec<u32> = Vec::new();
    let mut basins: Vec<Basin> = Vec::new();
    let mut labels = vec![NO_BODY; depth_sq.len()];
    for at in deepest_first(&depth_sq, least_depth_mm) {
        let at = at as usize;
        let voxel = lattice.voxel(at);
        let here_sq = depth_sq[at];
        let here = f64::from(here_sq).sqrt();
        let mut main: Option<u32> = None;
        let mut uphill = here_sq;
        for axis in 0..3 {
            let below = (voxel[axis] > 0).then(|| at - strides[axis]);
            let above = (voxel[axis] + 1 < lattice.size[axis]).then(|| at + strides[axis]);
            for next in below.into_iter().chain(above) {
                if labels[next] == NO_BODY {
                    continue;
                }
                let other = crate::topology::root(&mut parent, labels[next]);
                let steeper = depth_sq[next] > uphill;
                if steeper {
                    uphill = depth_sq[next];
                }
                main = Some(match main {
                    None => other,
                    Some(main) if main == other => main,
                    Some(main) => {
                        let peak = |b: u32| basins[b as usize].peak_mm;
                        if here >= neck_ratio * peak(main).min(peak(other)) {
                            merge(&mut parent, &mut basins, main, other)
                        } else if steeper {
                            other
                        } else {
                            main
                        }
                    }
                });
            }
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
        basin.voxels += 1;
        basin.bone_voxels += usize::from(tissue.is(at, BONE));
        for (axis, &place) in voxel.iter().enumerate() {
            basin.index_sum[axis] += place as f64;
            if axis != lattice.scan_axis && lattice.at_walls(voxel, axis).contains(&true) {
                basin.side_cut_mm2 += lattice.face_mm2[axis];
            }
        }
    }
    compact(labels, &mut parent, &basins)
}

impl Bodies {
    /// A point of each body in the `ct` frame, mm: the middle of its core if a core voxel is there, otherwise the centre of the nearest
    /// core voxel (the first of those equally near). The middle of a hollow body is outside it.
    pub fn points_inside(&self, lattice: &Lattice, grid: &Grid) -> Vec<Point3<f64>> {
        let low = lattice.low.map(|low| low as f64);
        let strides = lattice.strides();
        let middles: Vec<Point3<f64>> = self
            .basins
            .iter()
            .map(|basin| basin.centre(lattice, grid))
            .collect();
        let is_inside = |body: usize| {
            let mean = self.basins[body].mean_index();
            let at: usize = (0..3).map(|x| mean[x].round() as usize * strides[x]).sum();
            self.labels[at] as usize == body
        };
        let mut points = middles.clone();
        let hollow: Vec<bool> = (0..middles.len()).map(|body| !is_inside(body)).collect();
        if !hollow.contains(&true) {
            return points;
        }
        let mut nearest_sq = vec![f64::INFINITY; middles.len()];
        for (at, &body) in self.labels.iter().enumerate() {
            let body = body as usize;
            // No body has the label NO_BODY.
            if !hollow.get(body).is_some_and(|hollow| *hollow) {
                continue;
            }
            let voxel = lattice.voxel(at);
            let centre = grid.centre([0, 1, 2].map(|x| low[x] + voxel[x] as f64));
            let distance_sq = (centre - middles[body]).norm_squared();
            if distance_sq < nearest_sq[body] {
                nearest_sq[body] = distance_sq;
                points[body] = centre;
            }
        }
        points
    }
}

impl Basin {
    /// Middle of a body's core in the `ct` frame, mm.
    pub fn centre(&self, lattice: &Lattice, grid: &Grid) -> Point3<f64> {
        let mean = self.mean_index();
        grid.centre([0, 1, 2].map(|axis| lattice.low[axis] as f64 + mean[axis]))
    }

    /// Mean voxel of the core, within the box.
    fn mean_index(&self) -> [f64; 3] {
        self.index_sum.map(|sum| sum / self.voxels as f64)
    }
}

fn merge(parent: &mut [u32], basins: &mut [Basin], one: u32, other: u32) -> u32 {
    let (keep, gone) = (one.min(other), one.max(other));
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

/// Voxels at least `least_depth_mm` deep, deepest first, equal ones in memory order (counting sort).
fn deepest_first(depth_sq: &[f32], least_depth_mm: f64) -> Vec<u32> {
    let step = |squared: f32| (f64::from(squared).sqrt() / DEPTH_STEP_MM).min(1e5) as usize;
    let least_sq = (least_depth_mm * least_depth_mm) as f32;
    let deep = || {
        let voxels = depth_sq.iter().enumerate();
        voxels
            .filter(|(_, squared)| **squared >= least_sq)
            .map(|(at, &squared)| (at as u32, step(squared)))
    };
    let mut counts = Vec::new();
    for (_, step) in deep() {
        if step >= counts.len() {
            counts.resize(step + 1, 0);
        }
        counts[step] += 1;
    }
    let mut total = 0;
    for slot in counts.iter_mut().rev() {
        total += std::mem::replace(slot, total);
    }
    let mut order = vec![0; total];
    for (at, step) in deep() {
        order[counts[step]] = at;
        counts[step] += 1;
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
    for label in labels.iter_mut().filter(|label| **label != NO_BODY) {
        *label = numbers[crate::topology::root(parent, *label) as usize];
    }
    Bodies {
        labels,
        basins: kept,
    }
}
