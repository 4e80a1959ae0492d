//! Removal of everything but the limb from the volume.

use rayon::prelude::*;

use super::Hu;
use super::lattice::Lattice;

/// HU of removed voxels away from the limb.
const AIR_HU: f32 = -1000.0;
/// HU that replaces air enclosed by the limb.
const FILL_HU: f32 = 0.0;
/// Soft tissue above the usual iso value, HU.
const FLESH_HU: f32 = 550.0;
/// Share of limb around a removed voxel next to a flat contact, and the range around it that is used.
const FLAT_SHARE: f32 = 0.25;
const SHARE_RANGE: f32 = 0.2;

/// Values with everything but the limb removed and the limb filled.
///
/// Where the limb touched something removed, there is no edge in HU to interpolate, only the mask, and a
/// surface half-way between voxels would have steps. A removed voxel gets a value that puts the
/// surface half-way on a flat contact, nearer to it where limb surrounds it (the foot of a step) and
/// farther where it does not (the top of a step).
///
/// `hu` and `mask` cover the whole volume, the returned values the box.
pub fn cleaned<T: Hu>(part: &Lattice, hu: &[T], mask: &[bool], iso: f32) -> Vec<f32> {
    let mut values = vec![0.0; part.len()];
    let rows = values.par_chunks_mut(part.size[0]).enumerate();
    rows.for_each(|(row, values)| {
        let (line, inside) = (part.row_of(row, hu), part.row_of(row, mask));
        for i in 0..values.len() {
            let hu = line[i].into();
            values[i] = match (inside[i], hu >= iso) {
                (true, true) | (false, false) => hu,
                (true, false) => FILL_HU.max(iso),
                (false, true) => {
                    let voxel = part.voxel(row * part.size[0] + i);
                    let voxel = [0, 1, 2].map(|axis| voxel[axis] + part.low[axis]);
                    removed(share_around(part.whole, mask, voxel), iso)
                }
            };
        }
    });
    values
}

/// HU of a removed voxel with the given share of limb around it.
fn removed(share: f32, iso: f32) -> f32 {
    if share == 0.0 {
        return AIR_HU.min(iso - 1.0);
    }
    let bend = (share - FLAT_SHARE).clamp(-SHARE_RANGE, SHARE_RANGE);
    let along = 0.5 + bend;
    iso - FLESH_HU * (1.0 - along) / along
}

/// Share of limb around a voxel, weights 1-2-1 along each axis; border voxels are repeated.
fn share_around(size: [usize; 3], mask: &[bool], voxel: [usize; 3]) -> f32 {
    let nearby = |axis: usize| {
        let place = voxel[axis];
        let last = size[axis] - 1;
        let around = [place.saturating_sub(1), place, (place + 1).min(last)];
        around.into_iter().zip([0.25, 0.5, 0.25])
    };
    let mut share = 0.0;
    for (k, along_z) in nearby(2) {
        for (j, along_y) in nearby(1) {
            for (i, along_x) in nearby(0) {
                if mask[i + size[0] * (j + size[1] * k)] {
                    share += along_x * along_y * along_z;
                }
            }
        }
    }
    share
}
