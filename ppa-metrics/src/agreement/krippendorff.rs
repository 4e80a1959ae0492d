//! Krippendorff's α.

use super::ratings::Ratings;
use crate::error::MetricError;

/// Distance between two grades.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measurement {
    /// Equal or not.
    Nominal,
    /// By the number of given grades between them.
    Ordinal,
    /// By their difference.
    Interval,
    /// By their difference over their sum; grades are 0 or more.
    Ratio,
}

/// Krippendorff's α, 1 − observed/expected disagreement: 1 is perfect, 0 is chance level. Missing grades are
/// allowed; a subject with a single grade is left out (K. Krippendorff, Computing Krippendorff's
/// Alpha-Reliability, 2011).
///
/// # Errors
/// [`MetricError::Empty`] if no subject has two grades, [`MetricError::Constant`] if all grades are the same,
/// [`MetricError::BelowZero`] for a negative grade on a ratio scale.
pub fn krippendorff_alpha(ratings: &Ratings, measurement: Measurement) -> Result<f64, MetricError> {
    let paired: Vec<Vec<f64>> = ratings
        .rows()
        .map(|row| row.iter().flatten().copied().collect::<Vec<_>>())
        .filter(|grades| grades.len() >= 2)
        .collect();
    let mut grades: Vec<f64> = paired.iter().flatten().copied().collect();
    if grades.is_empty() {
        return Err(MetricError::Empty("subjects with two grades"));
    }
    let count = grades.len();
    grades.sort_unstable_by(f64::total_cmp);
    // −0 and 0 are the same grade.
    grades.dedup_by(|a, b| a == b);
    if grades.len() == 1 {
        return Err(MetricError::Constant {
            what: "grades",
            count,
            value: grades[0],
        });
    }
    if measurement == Measurement::Ratio && grades[0] < 0.0 {
        return Err(MetricError::BelowZero { found: grades[0] });
    }
    let index = |grade: &f64| {
        let found = grades.iter().position(|g| g == grade);
        found.expect("every grade is in the list")
    };
    let units: Vec<Vec<usize>> = paired
        .iter()
        .map(|unit| unit.iter().map(index).collect())
        .collect();
    let mut totals = vec![0.0; grades.len()];
    for &grade in units.iter().flatten() {
        totals[grade] += 1.0;
    }
    let squared = |a: usize, b: usize| squared_difference(measurement, &grades, &totals, a, b);
    let observed: f64 = units.iter().map(|unit| mean_within(unit, squared)).sum();
    let mut expected = 0.0;
    for a in 0..grades.len() {
        for b in 0..grades.len() {
            expected += totals[a] * totals[b] * squared(a, b);
        }
    }
    Ok(1.0 - (count as f64 - 1.0) * observed / expected)
}

/// Σ over ordered pairs of a subject's m grades, divided by m − 1.
fn mean_within(unit: &[usize], squared: impl Fn(usize, usize) -> f64) -> f64 {
    let pairs = unit.iter().flat_map(|&a| unit.iter().map(move |&b| (a, b)));
    let sum: f64 = pairs.map(|(a, b)| squared(a, b)).sum();
    sum / (unit.len() as f64 - 1.0)
}

/// δ² between the grades at `a` and `b`; `totals` counts each grade.
fn squared_difference(
    measurement: Measurement,
    grades: &[f64],
    totals: &[f64],
    a: usize,
    b: usize,
) -> f64 {
    if a == b {
        return 0.0;
    }
    let (low, high) = (a.min(b), a.max(b));
    match measurement {
        Measurement::Nominal => 1.0,
        Measurement::Ordinal => {
            let between: f64 = totals[low..=high].iter().sum();
            (between - 0.5 * (totals[low] + totals[high])).powi(2)
        }
        Measurement::Interval => (grades[a] - grades[b]).powi(2),
        Measurement::Ratio => ((grades[a] - grades[b]) / (grades[a] + grades[b])).powi(2),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    /// Krippendorff's own example of 4 readers and 12 units with gaps; expected: the package `krippendorff` 0.8.
    #[test]
    fn the_authors_example() {
        let n = None;
        let s = |grade: u8| Some(f64::from(grade));
        let by_reader = [
            [
                s(1),
                s(2),
                s(3),
                s(3),
                s(2),
                s(1),
                s(4),
                s(1),
                s(2),
                n,
                n,
                n,
            ],
            [
                s(1),
                s(2),
                s(3),
                s(3),
                s(2),
                s(2),
                s(4),
                s(1),
                s(2),
                s(5),
                n,
                s(3),
            ],
            [
                n,
                s(3),
                s(3),
                s(3),
                s(2),
                s(3),
                s(4),
                s(2),
                s(2),
                s(5),
                s(1),
                n,
            ],
            [
                s(1),
                s(2),
                s(3),
                s(3),
                s(2),
                s(4),
                s(4),
                s(1),
                s(2),
                s(5),
                s(1),
                n,
            ],
        ];
        let rows = (0..12).map(|unit| by_reader.iter().map(|row| row[unit]).collect());
        let ratings = Ratings::new(rows.collect()).unwrap();
        for (measurement, alpha) in [
            (Measurement::Nominal, 0.743_421_052_631_579),
            (Measurement::Ordinal, 0.815_387_503_754_881_4),
            (Measurement::Interval, 0.849_107_142_857_142_8),
            (Measurement::Ratio, 0.797_402_774_711_612_1),
        ] {
            let found = krippendorff_alpha(&ratings, measurement).unwrap();
            assert_abs_diff_eq!(found, alpha, epsilon = 1e-14);
        }
    }

    #[test]
    fn perfect_chance_and_no_agreement() {
        let alpha = |rows: &[[f64; 2]]| {
            let rows = rows
                .iter()
                .map(|row| row.iter().map(|&g| Some(g)).collect());
            krippendorff_alpha(&Ratings::new(rows.collect()).unwrap(), Measurement::Ordinal)
        };
        assert_eq!(alpha(&[[1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]).unwrap(), 1.0);
        assert!(alpha(&[[1.0, 3.0], [3.0, 1.0]]).unwrap() < 0.0);
        assert!(matches!(
            alpha(&[[2.0, 2.0], [2.0, 2.0]]),
            Err(MetricError::Constant { count: 4, .. })
        ));
        let below = Ratings::new(vec![vec![Some(-1.0), Some(1.0)]; 2]).unwrap();
        assert_eq!(
            krippendorff_alpha(&below, Measurement::Ratio),
            Err(MetricError::BelowZero { found: -1.0 })
        );
        let apart = Ratings::new(vec![vec![Some(1.0), None], vec![None, Some(2.0)]]).unwrap();
        assert_eq!(
            krippendorff_alpha(&apart, Measurement::Nominal),
            Err(MetricError::Empty("subjects with two grades"))
        );
    }
}
