//! Detection of the couch, which is thin and the same in every slice.

use rayon::prelude::*;

use super::Hu;
use super::distance::squared_distances;
use super::lattice::Lattice;
use super::pieces::Pieces;

/// Columns of voxels along the scan axis, in the order of the two other axes (lower one fastest).
pub struct Columns {
    axes: [usize; 2],
    size: [usize; 2],
    /// Voxels of tissue in each column.
    pub tissue: Vec<u32>,
    /// Whether each column is couch.
    pub couch: Vec<bool>,
}

impl Columns {
    pub fn is_couch(&self, voxel: [usize; 3]) -> bool {
        self.couch[voxel[self.axes[0]] + self.size[0] * voxel[self.axes[1]]]
    }

    /// Voxels of tissue in couch columns.
    pub fn couch_voxels(&self) -> usize {
        let columns = self.tissue.iter().zip(&self.couch);
        columns.filter(|(_, c)| **c).map(|(n, _)| *n as usize).sum()
    }
}

/// Finds the couch in a volume.
///
/// A couch is solid at the same place in nearly all slices, whatever lies on it. So is the middle
/// of a limb, but that is thick. Persistent columns that an opening with a disk removes are thin and,
/// if they form long pieces, couch.
pub fn couch_columns<T: Hu>(
    lattice: &Lattice,
    hu: &[T],
    iso: f32,
    persistence: f64,
    thickness_mm: f64,
) -> Columns {
    let axes = lattice.across();
    let size = [lattice.size[axes[0]], lattice.size[axes[1]], 1];
    let spacing = [
        lattice.spacing_mm[axes[0]],
        lattice.spacing_mm[axes[1]],
        1.0,
    ];
    let slices = lattice.size[lattice.scan_axis];
    let tissue = tissue_of_columns(lattice, hu, iso);
    let persistent: Vec<bool> = tissue
        .iter()
        .map(|&count| f64::from(count) >= persistence * slices as f64)
        .collect();

    // Opening: a column is thick when it lies within the radius of one that has the radius around it.
    let radius_sq = (0.5 * thickness_mm).powi(2) as f32;
    let depth = squared_distances(size, spacing, |at| !persistent[at]);
    let reach = squared_distances(size, spacing, |at| depth[at] > radius_sq);
    let thin = |at: usize| persistent[at] && reach[at] > radius_sq;

    // Slivers along the border of a thick part are short; a couch is several times longer than thick.
    let long_mm = 3.0 * thickness_mm;
    let plane = Lattice {
        low: [0; 3],
        size,
        whole: size,
        spacing_mm: spacing,
        voxel_mm3: spacing.iter().product(),
        face_mm2: [0, 1, 2].map(|axis| spacing[(axis + 1) % 3] * spacing[(axis + 2) % 3]),
        scan_axis: 2,
    };
    let pieces = Pieces::of(&plane, thin);
    let mut spans = vec![[usize::MAX, 0, usize::MAX, 0]; pieces.count];
    for (piece, run) in pieces.runs() {
        let [i0, j, _] = plane.voxel(run.start);
        let span = &mut spans[piece];
        *span = [
            span[0].min(i0),
            span[1].max(i0 + run.len() - 1),
            span[2].min(j),
            span[3].max(j),
        ];
    }
    let mut couch = vec![false; tissue.len()];
    for (piece, run) in pieces.runs() {
        let [i0, i1, j0, j1] = spans[piece];
        let across = ((i1 - i0) as f64 * spacing[0]).hypot((j1 - j0) as f64 * spacing[1]);
        couch[run].fill(across >= long_mm);
    }
    Columns {
        axes,
        size: [size[0], size[1]],
        tissue,
        couch,
    }
}

fn tissue_of_columns<T: Hu>(lattice: &Lattice, hu: &[T], iso: f32) -> Vec<u32> {
    let [nx, ny, nz] = lattice.size;
    let [u, v] = lattice.across();
    let empty = || vec![0_u32; lattice.size[u] * lattice.size[v]];
    hu.par_chunks(nx * ny)
        .with_min_len(nz.div_ceil(4 * rayon::current_num_threads()))
        .enumerate()
        .fold(empty, |mut counts, (k, slice)| {
            for (j, row) in slice.chunks(nx).enumerate() {
                let tissue = row.iter().map(|&value| u32::from(value.into() >= iso));
                match lattice.scan_axis {
                    0 => counts[j + ny * k] += tissue.sum::<u32>(),
                    axis => {
                        let first = nx * if axis == 1 { k } else { j };
                        let counts = &mut counts[first..first + nx];
                        counts.iter_mut().zip(tissue).for_each(|(n, t)| *n += t);
                    }
                }
            }
            counts
        })
        .reduce(empty, |mut sum, part| {
            sum.iter_mut().zip(part).for_each(|(n, more)| *n += more);
            sum
        })
}
