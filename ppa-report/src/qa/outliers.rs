//! Poses that do not follow from their neighbours.
//!
//! A limb rotated in steps rises and tilts smoothly. A value is reported if its distance from the line between its two neighbours is
//! much larger than the bend usual in its sweep explains. Where poses are missing, that line is longer: a smooth curve deviates from it
//! by half its second derivative times the product of the steps on both sides.
//!
//! The first and the last pose have neighbours on one side only. Such an end must be off two lines, through the first and second and
//! through the third and fourth pose from it: if one of these four is the outlier, one of the lines does not contain it. The pose next
//! to an outlier at an end is compared with the line through the two poses after it.

/// Smallest deviation of an outlier relative to the usual bend.
const FACTOR: f64 = 8.0;

/// Factor on this limit at an end: noise of two points is up to four times as large if their line is extrapolated four steps from
/// the nearer one.
const AT_ENDS: f64 = 4.0;

/// In shorter sweeps an outlier distorts the median: it affects three of the distances.
pub(super) const LEAST_POSES: usize = 9;

/// A distance from a line, and the product of the steps to both its points.
#[derive(Clone, Copy)]
struct Off {
    distance: f64,
    steps: f64,
}

/// Distance of a point from the line through two others.
fn off(point: [f64; 2], [a, b]: [[f64; 2]; 2]) -> Off {
    let [from_a, from_b] = [point[0] - a[0], point[0] - b[0]];
    let line = (b[1] * from_a - a[1] * from_b) / (b[0] - a[0]);
    Off {
        distance: (point[1] - line).abs(),
        steps: (from_a * from_b).abs(),
    }
}

/// Positions of the points (an increasing parameter with a value each) that are off the line between their neighbours by more than
/// `floor` and by more than [`FACTOR`] times what the median bend of the sweep explains.
///
/// An outlier also shifts the lines of both its neighbours, but by less: of adjacent ones, only the largest counts.
pub(super) fn outliers(points: &[[f64; 2]], floor: f64) -> Vec<usize> {
    let inner = points.windows(3).map(|p| off(p[1], [p[0], p[2]]));
    let mut inner: Vec<Off> = inner.collect();
    let mut bends: Vec<f64> = inner.iter().map(|off| off.distance / off.steps).collect();
    bends.sort_unstable_by(f64::total_cmp);
    let Some(&median) = bends.get(bends.len() / 2) else {
        return Vec::new();
    };
    let stands_out = |off: Off, floor: f64| off.distance > floor.max(FACTOR * median * off.steps);
    let last = points.len() - 1;
    let mut found = Vec::new();
    if points.len() >= LEAST_POSES {
        for end in [0, last] {
            let [first, second, third, fourth] = [1, 2, 3, 4].map(|n| points[end.abs_diff(n)]);
            let lines = [[first, second], [third, fourth]];
            let is_off = |line| stands_out(off(points[end], line), AT_ENDS * floor);
            if lines.into_iter().all(is_off) {
                found.push(end);
                inner[end.abs_diff(1) - 1] = off(first, [second, third]);
            }
        }
    }
    let at = |i: usize| inner.get(i).map_or(0.0, |off| off.distance);
    let largest = |&i: &usize| {
        stands_out(inner[i], floor) && at(i) >= at(i + 1) && (i == 0 || at(i) >= at(i - 1))
    };
    found.extend((0..inner.len()).filter(largest).map(|i| i + 1));
    found.sort_unstable();
    found
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
        for at in [0, 1, 2, 90, 178, 179, 180] {
            for jump_mm in [3.0, -3.0] {
                let mut jump = smooth.clone();
                jump[at][1] += jump_mm;
                assert_eq!(outliers(&jump, 0.5), [at]);
            }
        }
        let mut both = smooth.clone();
        both[0][1] -= 4.0;
        both[180][1] += 4.0;
        assert_eq!(outliers(&both, 0.5), [0, 180]);
        assert!(outliers(&[[0.0, 1.0], [1.0, 2.0]], 0.5).is_empty());
    }

    /// From 80 to 110 the sine bends most: next to the gap it is off the line by 1 mm, which is not an outlier.
    #[test]
    fn poses_beside_a_hole_are_none_and_a_jump_beside_it_is() {
        let mut holed = sweep((0..80).chain(110..181));
        assert_eq!(outliers(&holed, 0.05), [0_usize; 0]);
        holed[79][1] += 6.0;
        assert_eq!(outliers(&holed, 0.05), [79]);
    }
}
