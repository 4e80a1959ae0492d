//! Poses that do not follow from their neighbours.
//!
//! A limb that turns step by step rises and tilts smoothly. A value whose distance from the middle of its two neighbours is much
//! larger than usual in its sweep is told.

/// How far beyond the usual distance a pose must be.
const FACTOR: f64 = 8.0;

/// In shorter sweeps a pose that stands out spoils what is usual: it moves three of the distances.
pub(super) const LEAST_POSES: usize = 9;

/// Positions of the values (in order of a parameter in equal steps) that lie off the line between their neighbours by more than
/// `floor` and [`FACTOR`] times the median of such distances.
///
/// An outlier pulls the lines of both its neighbours as well, by half as much: only the largest of adjacent ones counts.
pub(super) fn outliers(values: &[f64], floor: f64) -> Vec<usize> {
    let off: Vec<f64> = values
        .windows(3)
        .map(|v| (v[1] - 0.5 * (v[0] + v[2])).abs())
        .collect();
    let mut sorted = off.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let Some(&median) = sorted.get(sorted.len() / 2) else {
        return Vec::new();
    };
    let limit = floor.max(FACTOR * median);
    let at = |i: usize| off.get(i).copied().unwrap_or(0.0);
    let largest =
        |&i: &usize| off[i] > limit && off[i] >= at(i + 1) && (i == 0 || off[i] >= at(i - 1));
    (0..off.len()).filter(largest).map(|i| i + 1).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jump_is_found_in_a_smooth_sweep_and_none_without() {
        let smooth: Vec<f64> = (0..181)
            .map(|i| 40.0 * f64::from(i).to_radians().sin())
            .collect();
        assert!(outliers(&smooth, 0.5).is_empty());
        for at in [1, 90, 179] {
            let mut jump = smooth.clone();
            jump[at] += 3.0;
            assert_eq!(outliers(&jump, 0.5), [at]);
        }
        assert!(outliers(&[1.0, 2.0], 0.5).is_empty());
    }
}
