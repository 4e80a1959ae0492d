//! The border between the limb and a body that touches it.

use super::lattice::Lattice;

/// Rounds of voting; they remove ripples of the border up to this many voxels long.
const ROUNDS: usize = 4;

/// The border between a limb and the bodies that touch it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touching {
    /// Area of the faces of voxels between both, mm².
    pub area_mm2: f64,
    /// Mean position of the limb's voxels at the border, voxel indices within the box.
    pub voxel: [f64; 3],
}

impl Touching {
    /// Returns `None` if nothing touches the limb; `flesh` is the limb and everything that may touch it.
    pub fn of(lattice: &Lattice, flesh: &[bool], inside: &[bool]) -> Option<Self> {
        let strides = lattice.strides();
        let (mut area_mm2, mut faces, mut sum) = (0.0, 0_usize, [0.0; 3]);
        for at in (0..inside.len()).filter(|at| inside[*at]) {
            let voxel = lattice.voxel(at);
            for axis in 0..3 {
                let below = (voxel[axis] > 0).then(|| at - strides[axis]);
                let above = (voxel[axis] + 1 < lattice.size[axis]).then(|| at + strides[axis]);
                let others = below.into_iter().chain(above);
                let touching = others.filter(|next| flesh[*next] && !inside[*next]).count();
                area_mm2 += touching as f64 * lattice.face_mm2[axis];
                faces += touching;
                (0..3).for_each(|x| sum[x] += (touching * voxel[x]) as f64);
            }
        }
        (faces > 0).then(|| Self {
            area_mm2,
            voxel: sum.map(|sum| sum / faces as f64),
        })
    }
}

/// Smooths the border between `inside` and the rest of `flesh`; the border towards air stays.
///
/// In a contact, HU do not show where one body ends, and the watershed's border follows the lattice
/// in steps and single rows of voxels. Each voxel of the border goes to the body that has more of the
/// flesh around it (weights 1-2-1 along each axis).
pub fn smooth_contacts(lattice: &Lattice, flesh: &[bool], inside: &mut [bool]) {
    for _ in 0..ROUNDS {
        let turned: Vec<usize> = (0..inside.len())
            .filter(|&at| flesh[at] && outvoted(lattice, flesh, inside, at))
            .collect();
        for at in turned {
            inside[at] = !inside[at];
        }
    }
}

/// Whether more than half of the flesh around a voxel is of the other kind.
fn outvoted(lattice: &Lattice, flesh: &[bool], inside: &[bool], at: usize) -> bool {
    let (voxel, strides) = (lattice.voxel(at), lattice.strides());
    let other = |next: usize| flesh[next] && inside[next] != inside[at];
    let at_border = (0..3).any(|axis| {
        voxel[axis] > 0 && other(at - strides[axis])
            || voxel[axis] + 1 < lattice.size[axis] && other(at + strides[axis])
    });
    if !at_border {
        return false;
    }
    let mut majority = 0;
    for steps in 0..27 {
        let step = [steps % 3, steps / 3 % 3, steps / 9];
        let place = [0, 1, 2].map(|axis| voxel[axis] + step[axis]);
        // Steps count from one voxel before.
        if (0..3).all(|axis| (1..=lattice.size[axis]).contains(&place[axis])) {
            let next = (0..3).map(|axis| (place[axis] - 1) * strides[axis]).sum();
            let weight: i32 = step.map(|s| if s == 1 { 2 } else { 1 }).iter().product();
            majority += match (flesh[next], other(next)) {
                (false, _) => 0,
                (true, true) => weight,
                (true, false) => -weight,
            };
        }
    }
    majority > 0
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 3] = [14, 9, 9];

    /// Flesh with air above y = 7; the limb ends at `end(y, z)` in each row.
    fn smoothed(end: impl Fn(usize, usize) -> usize) -> (Vec<bool>, Vec<bool>) {
        let lattice = Lattice {
            low: [0; 3],
            size: SIZE,
            whole: SIZE,
            spacing_mm: [1.0; 3],
            voxel_mm3: 1.0,
            face_mm2: [1.0; 3],
            scan_axis: 2,
        };
        let voxels = || (0..lattice.len()).map(|at| lattice.voxel(at));
        let flesh: Vec<bool> = voxels().map(|[_, y, _]| y < 7).collect();
        let before: Vec<bool> = voxels().map(|[x, y, z]| y < 7 && x < end(y, z)).collect();
        let mut after = before.clone();
        smooth_contacts(&lattice, &flesh, &mut after);
        (before, after)
    }

    #[test]
    fn a_flat_contact_stays() {
        let (before, after) = smoothed(|_, _| 6);
        assert_eq!(before, after);
    }

    #[test]
    fn ripples_and_single_rows_go_and_air_stays_air() {
        let (_, rippled) = smoothed(|y, z| if (y + z) % 2 == 0 { 4 } else { 8 });
        let (_, row) = smoothed(|y, z| if [y, z] == [3, 4] { 12 } else { 6 });
        for (after, most) in [(rippled, 2), (row, 1)] {
            let rows = after.chunks(SIZE[0]).enumerate();
            let ends = rows.filter(|(row, _)| row % SIZE[1] < 7);
            let ends = ends.map(|(_, row)| row.iter().filter(|inside| **inside).count());
            let (low, high) = ends.fold((SIZE[0], 0), |(l, h), end| (l.min(end), h.max(end)));
            assert!(low > 0 && high - low <= most, "{low} to {high}");
            let in_air = (0..after.len()).filter(|at| at / SIZE[0] % SIZE[1] >= 7);
            assert!(!in_air.into_iter().any(|at| after[at]));
        }
    }
}
