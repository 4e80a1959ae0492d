//! The couch: thin, and the same in every slice.

use super::distance::nearest;
use super::lattice::Lattice;

/// Columns along the scan axis that are couch, in the order of the two other axes (lower one
/// fastest).
///
/// A couch is solid in nearly all slices at the same place, whatever lies on it. So is the middle
/// of a limb, but that is thick: what is left when the persistent columns are opened with a disk is
/// thin and, if long enough, couch.
pub fn couch_columns(
    lattice: &Lattice,
    tissue: &[bool],
    persistence: f64,
    thickness_mm: f64,
) -> Vec<bool> {
    let [u, v] = lattice.across();
    let size = [lattice.size[u], lattice.size[v], 1];
    let spacing = [lattice.spacing_mm[u], lattice.spacing_mm[v], 1.0];
    let slices = lattice.size[lattice.scan_axis];
    let mut solid = vec![0_usize; size[0] * size[1]];
    for (at, _) in tissue.iter().enumerate().filter(|(_, t)| **t) {
        solid[lattice.column(at)] += 1;
    }
    let persistent: Vec<bool> = solid
        .iter()
        .map(|&count| count as f64 >= persistence * slices as f64)
        .collect();

    // Opening: a column is thick when it lies within the radius of one that has the radius around it.
    let radius_sq = (0.5 * thickness_mm).powi(2) as f32;
    let outside: Vec<bool> = persistent.iter().map(|p| !p).collect();
    let (depth, _) = nearest(size, spacing, &outside);
    let deep: Vec<bool> = depth.iter().map(|d| *d > radius_sq).collect();
    let (reach, _) = nearest(size, spacing, &deep);
    let thin: Vec<bool> = (0..persistent.len())
        .map(|at| persistent[at] && reach[at] > radius_sq)
        .collect();

    // Slivers along the border of a thick part are short; a couch is several times longer than thick.
    let long_mm = 3.0 * thickness_mm;
    let pieces = Lattice {
        size,
        spacing_mm: spacing,
        scan_axis: 2,
    }
    .components(&thin);
    let mut spans = vec![[usize::MAX, 0, usize::MAX, 0]; pieces.count];
    for (at, label) in pieces.labels.iter().enumerate() {
        if let Some(span) = spans.get_mut(*label as usize) {
            let (i, j) = (at % size[0], at / size[0]);
            *span = [
                span[0].min(i),
                span[1].max(i),
                span[2].min(j),
                span[3].max(j),
            ];
        }
    }
    let long = |label: u32| {
        spans.get(label as usize).is_some_and(|[i0, i1, j0, j1]| {
            let across = ((i1 - i0) as f64 * spacing[0]).hypot((j1 - j0) as f64 * spacing[1]);
            across >= long_mm
        })
    };
    pieces.labels.iter().map(|&label| long(label)).collect()
}
