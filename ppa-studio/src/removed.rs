//! The surface of the parts removed from a scan: couch, sheets, other bodies, and the hollows of the limb that count as limb.

use nalgebra::{Point3, Vector3};
use ppa_ct::{Volume, VolumeError};
use rayon::prelude::*;

/// Value of voxels in the limb, or so near its skin that their side is undetermined in a coarse scan.
const NOTHING_HU: f32 = -2000.0;

/// Returns a coarse scan whose surface at `iso_hu` is that of the removed parts: the scan itself outside the limb, and inside it
/// the scan mirrored at `iso_hu`, so that hollows become bodies. Voxels within one voxel of the skin are left out.
///
/// `mask` marks the voxels of `scan` in the limb; the axes of both grids are parallel.
pub(crate) fn removed(
    coarse: &Volume,
    scan: &Volume,
    mask: &[bool],
    iso_hu: f32,
) -> Result<Volume, VolumeError> {
    let (grid, fine) = (coarse.grid(), scan.grid());
    let size = grid.size();
    let fine_from_coarse = fine.voxel_from_ct() * grid.ct_from_voxel();
    let origin = fine_from_coarse * Point3::origin();
    let nearest = [0, 1, 2].map(|axis| {
        let mut step = Vector3::zeros();
        step[axis] = 1.0;
        let step = (fine_from_coarse * step)[axis];
        let last = fine.size()[axis] - 1;
        let place = move |at: usize| (origin[axis] + step * at as f64).round().max(0.0) as usize;
        (0..size[axis])
            .map(|at| place(at).min(last))
            .collect::<Vec<usize>>()
    });
    let mut inside = vec![false; grid.len()];
    inside
        .par_chunks_mut(size[0])
        .enumerate()
        .for_each(|(row, line)| {
            let start = fine.index([0, nearest[1][row % size[1]], nearest[2][row / size[1]]]);
            for (inside, i) in line.iter_mut().zip(&nearest[0]) {
                *inside = mask[start + i];
            }
        });
    let outside: Vec<bool> = inside.iter().map(|inside| !inside).collect();
    let (near_limb, near_rest) = (dilated(size, inside), dilated(size, outside));
    let mut hu = coarse.hu().into_owned();
    hu.par_chunks_mut(size[0])
        .enumerate()
        .for_each(|(row, line)| {
            let voxels = row * size[0]..row * size[0] + line.len();
            let sides = near_limb[voxels.clone()].iter().zip(&near_rest[voxels]);
            for (hu, (near_limb, near_rest)) in line.iter_mut().zip(sides) {
                *hu = match (near_limb, near_rest) {
                    (false, _) => hu.max(NOTHING_HU),
                    (true, false) => (2.0 * iso_hu - *hu).max(NOTHING_HU),
                    (true, true) => NOTHING_HU,
                };
            }
        });
    Volume::new(grid.clone(), hu)
}

/// Returns the mask and the voxels that share a face, an edge or a corner with it.
fn dilated(size: [usize; 3], mut mask: Vec<bool>) -> Vec<bool> {
    let strides = [1, size[0], size[0] * size[1]];
    for (stride, count) in strides.into_iter().zip(size) {
        let before = mask.clone();
        // Lines along the axis form blocks of `count` layers of `stride` voxels.
        let block = stride * count;
        for (grown, before) in mask.chunks_mut(block).zip(before.chunks(block)) {
            let (lower, upper) = (&before[..block - stride], &before[stride..]);
            for (grown, before) in grown[stride..].iter_mut().zip(lower) {
                *grown |= before;
            }
            for (grown, before) in grown.iter_mut().zip(upper) {
                *grown |= before;
            }
        }
    }
    mask
}

#[cfg(test)]
mod tests {
    use super::*;
    use ppa_ct::Grid;

    #[test]
    fn a_dilated_voxel_is_a_block_that_ends_at_the_border() {
        let size = [4, 3, 5];
        let mut mask = vec![false; 60];
        // Voxel (3, 1, 2).
        mask[3 + 4 * (1 + 3 * 2)] = true;
        let found = dilated(size, mask);
        for (at, found) in found.into_iter().enumerate() {
            let [i, k] = [at % 4, at / 12];
            assert_eq!(found, i >= 2 && (1..=3).contains(&k), "{at}");
        }
    }

    /// A ball with an air bubble in it, and a small removed ball next to it, with half of the voxels along each axis.
    #[test]
    fn bodies_and_hollows_stay_and_the_skin_goes() {
        let grid = |side: usize, spacing_mm: f64| {
            let first = Point3::from(Vector3::repeat(0.5 * spacing_mm));
            Grid::axis_aligned([side; 3], Vector3::repeat(spacing_mm), first).unwrap()
        };
        let far = |p: &Point3<f64>, x: f64| (p - Point3::new(x, 40.0, 40.0)).norm();
        let hu = |p: &Point3<f64>| match (far(p, 30.0), far(p, 66.0)) {
            (r, _) if r < 5.0 => -1000.0,
            (r, _) if r < 20.0 => 50.0,
            (_, r) if r < 8.0 => 50.0,
            _ => -1000.0,
        };
        let volume = |grid: &Grid| {
            let centres = (0..grid.len()).map(|at| grid.centre(grid.voxel(at).map(|v| v as f64)));
            Volume::new(grid.clone(), centres.map(|p| hu(&p)).collect()).unwrap()
        };
        let (scan, coarse) = (volume(&grid(80, 1.0)), volume(&grid(40, 2.0)));
        let voxels = 0..scan.grid().len();
        let centres = voxels.map(|at| scan.grid().centre(scan.grid().voxel(at).map(|v| v as f64)));
        let mask: Vec<bool> = centres.map(|p| far(&p, 30.0) < 20.0).collect();
        let shown = removed(&coarse, &scan, &mask, -500.0).unwrap();
        let mut counts = [0, 0];
        for at in 0..shown.grid().len() {
            let centre = shown
                .grid()
                .centre(shown.grid().voxel(at).map(|v| v as f64));
            let is_shown = shown.values().at(at) >= -500.0;
            let [bubble, ball] = [far(&centre, 30.0) < 5.0, far(&centre, 66.0) < 8.0];
            assert_eq!(is_shown, bubble || ball, "{centre}");
            counts[0] += usize::from(bubble);
            counts[1] += usize::from(ball);
        }
        assert!(counts[0] > 30 && counts[1] > 200, "{counts:?}");
    }
}
