//! The volume with nothing but the limb in it, as the surface sees it.

use ppa_ct::Volume;
use rayon::prelude::*;

/// HU put where something was removed, away from the limb.
const AIR_HU: f32 = -1000.0;
/// HU put into air enclosed by the limb.
const FILL_HU: f32 = 0.0;
/// Soft tissue above the usual iso value, HU.
const FLESH_HU: f32 = 550.0;
/// Share of limb around a removed voxel next to a flat contact, and the range around it that is used.
const FLAT_SHARE: f32 = 0.25;
const SHARE_RANGE: f32 = 0.2;

/// Everything but the limb removed and the limb filled.
///
/// Where the limb touched what was removed there is no edge in HU to interpolate, only the mask, and a
/// surface half-way between voxels would have steps. A removed voxel gets a value that puts the
/// surface half-way on a flat contact, nearer to it where limb surrounds it (the foot of a step) and
/// farther where it does not (the top of a step).
pub fn cleaned(volume: &Volume, mask: &[bool], iso: f32) -> Volume {
    let (hu, size) = (volume.hu(), volume.grid().size());
    let values = (0..hu.len())
        .into_par_iter()
        .map(|at| match (mask[at], hu[at] >= iso) {
            (true, true) | (false, false) => hu[at],
            (true, false) => FILL_HU.max(iso),
            (false, true) => match share_around(size, mask, at) {
                0.0 => AIR_HU.min(iso - 1.0),
                share => {
                    let bend = (share - FLAT_SHARE).clamp(-SHARE_RANGE, SHARE_RANGE);
                    let along = 0.5 + bend;
                    iso - FLESH_HU * (1.0 - along) / along
                }
            },
        })
        .collect();
    Volume::new(volume.grid().clone(), values).expect("same grid, finite values")
}

/// Share of limb around a voxel, weights 1-2-1 along each axis; the border repeats.
fn share_around(size: [usize; 3], mask: &[bool], at: usize) -> f32 {
    let strides = [1, size[0], size[0] * size[1]];
    let mut share = 0.0;
    for step in 0..27_usize {
        let (mut there, mut weight) = (at, 1.0 / 64.0);
        for axis in 0..3 {
            let place = at / strides[axis] % size[axis];
            match step / 3_usize.pow(axis as u32) % 3 {
                0 if place > 0 => there -= strides[axis],
                2 if place + 1 < size[axis] => there += strides[axis],
                1 => weight *= 2.0,
                _ => {}
            }
        }
        if mask[there] {
            share += weight;
        }
    }
    share
}
