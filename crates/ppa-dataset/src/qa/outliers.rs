//! Poses that do not follow from their neighbours.
//!
//! A limb that turns step by step rises and tilts smoothly. A value whose distance from the line between its two neighbours is
//! much larger than the bend usual in its sweep explains is told. Where poses are missing, that line is longer: a smooth curve
//! leaves it by half its second derivative times the product of the steps on both sides.

/// How far beyond the usual bend a pose must be.
const FACTOR: f64 = 8.0;

/// In shorter sweeps a pose that stands out spoils what is usual: it moves three of the distances.
pub(super) const LEAST_POSES: usize = 9;

/// Positions of the points (a rising parameter with a value each) that lie off the line between their neighbours by more than
/// `floor` and [`FACTOR`] times what the median bend of the sweep explains.
///
/// An outlier pulls the lines of both its neighbours as well, but by less: only the largest of adjacent ones counts.
pub(super) fn outliers(points: &[[f64; 2]], floor: f64) -> Vec<usize> {
    // Distance from the line, and the product of the steps on both sides.
    let off: Vec<[f64; 2]> = points
        .windows(3)
        .map(|p| {
            let [before, after] = [p[1][0] - p[0][0], p[2][0] - p[1][0]];
            let line = (p[0][1] * after + p[2][1] * before) / (before + after);
            [(p[1][1] - line).abs(), before * after]
        })
        .collect();
    let mut bends: Vec<f64> = off.iter().map(|[off, steps]| off / steps).collect();
    bends.sort_unstable_by(f64::total_cmp);
    let Some(&median) = bends.get(bends.len() / 2) else {
        return Vec::new();
    };
    let excess = |i: usize| {
        let [off, steps] = off[i];
        off - floor.max(FACTOR * median * steps)
    };
    let at = |i: usize| off.get(i).map_or(0.0, |[off, _]| *off);
    let largest = |&i: &usize| {
        excess(i) > 0.0 && off[i][0] >= at(i + 1) && (i == 0 || off[i][0] >= at(i - 1))
    };
    (0..off.len()).filter(largest).map(|i| i + 1).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep(steps: impl Iterator<Item = u32>) -> Vec<[f64; 2]> {
        let point = |step: u32| {
            let angle = f64::from(step);
            [angle, 40.0 * angle.to_radians().sin()]
        };
        steps.map(point).collect()
    }

    #[test]
    fn a_jump_is_found_in_a_smooth_sweep_and_none_without() {
        let smooth = sweep(0..181);
        assert!(outliers(&smooth, 0.5).is_empty());
        for at in [1, 90, 179] {
            let mut jump = smooth.clone();
            jump[at][1] += 3.0;
            assert_eq!(outliers(&jump, 0.5), [at]);
        }
        assert!(outliers(&[[0.0, 1.0], [1.0, 2.0]], 0.5).is_empty());
    }

    /// From 80 to 110 the sine bends most: beside the hole it leaves the line by 1 mm, which is no outlier.
    #[test]
    fn poses_beside_a_hole_are_none_and_a_jump_beside_it_is() {
        let mut holed = sweep((0..80).chain(110..181));
        assert_eq!(outliers(&holed, 0.05), [0_usize; 0]);
        holed[79][1] += 6.0;
        assert_eq!(outliers(&holed, 0.05), [79]);
    }
}
