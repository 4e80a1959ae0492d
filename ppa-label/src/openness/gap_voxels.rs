//! The voxels of a gutter.

use nalgebra::Point3;

use super::blocks::Blocks;
use super::bones::AnkleBones;
use super::gutter::Gap;

/// Voxels of the gaps of a gutter, over the box around the joint.
#[derive(Debug, Clone)]
pub(super) struct GapVoxels {
    size: [usize; 3],
    within: Vec<bool>,
    /// Blocks without a gap voxel are uniform.
    blocks: Blocks,
}

impl GapVoxels {
    /// The voxels nearest to the points of each gap, from the talus to the other bone.
    pub fn of(gaps: &[Gap], bones: &AnkleBones) -> Self {
        let size @ [nx, ny, nz] = bones.size();
        let mut within = vec![false; nx * ny * nz];
        let step = 0.3 * bones.coarseness_mm();
        for gap in gaps {
            let steps = (gap.width_mm / step).ceil() as usize;
            for n in 0..=steps {
                let t = gap.width_mm * n as f64 / steps as f64;
                let v = bones.voxel(&(gap.foot + gap.across * t));
                let v = v.map(|c| c.round() as usize);
                within[(v.z * ny + v.y) * nx + v.x] = true;
            }
        }
        let held = |low: [usize; 3], high: [usize; 3]| {
            let mut rows =
                (low[2]..high[2]).flat_map(|k| (low[1]..high[1]).map(move |j| (k * ny + j) * nx));
            let empty = !rows.any(|row| within[row + low[0]..row + high[0]].contains(&true));
            empty.then_some(false)
        };
        let blocks = Blocks::new(size, held);
        Self {
            size,
            within,
            blocks,
        }
    }

    /// How many voxels every coordinate of a point may change before it can enter a gap; `None` if the nearest voxel belongs to one.
    pub fn free_voxels(&self, point: &Point3<f64>) -> Option<usize> {
        let [nx, ny, _] = self.size;
        let mut nearest = [0; 3];
        for axis in 0..3 {
            let at = nearest_whole(point[axis]).filter(|&at| at < self.size[axis]);
            let Some(at) = at else { return Some(0) };
            nearest[axis] = at;
        }
        let [i, j, k] = nearest;
        match self.blocks.uniform(nearest) {
            Some((_, free)) => Some(free),
            None => (!self.within[(k * ny + j) * nx + i]).then_some(0),
        }
    }
}

/// `value.round()`, halves away from 0, if that is at least 0; avoids the call into the C library that `round` is on plain x86-64.
fn nearest_whole(value: f64) -> Option<usize> {
    if value <= -0.5 {
        return None;
    }
    let below = value as usize;
    Some(below + usize::from(value - below as f64 >= 0.5))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn nearest_whole_is_round(value in prop_oneof![-2.0..300.0_f64, (-4..600_i32).prop_map(|n| 0.5 * f64::from(n)),
            Just(0.5_f64.next_down()), Just(-0.5_f64.next_up())]) {
            let round = value.round();
            prop_assert_eq!(nearest_whole(value), (round >= 0.0).then_some(round as usize));
        }
    }
}
