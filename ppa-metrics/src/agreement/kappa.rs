//! Cohen's weighted κ of two readers.

use crate::error::{MetricError, check_pair};

/// Weight of a disagreement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KappaWeights {
    /// Any disagreement counts 1.
    Equal,
    /// The absolute difference of the grades.
    Linear,
    /// The squared difference.
    Quadratic,
}

/// Cohen's κ, 1 − observed/expected disagreement, expected from each reader's own frequencies (J. Cohen, Psychol.
/// Bull. 70, 1968). Differences are those of the grades' values, so a half step has half the difference of a whole one.
///
/// # Errors
/// [`MetricError::Constant`] if both readers gave one and the same grade throughout; empty, unequal or non-finite input.
pub fn weighted_kappa(
    first: &[f64],
    second: &[f64],
    weights: KappaWeights,
) -> Result<f64, MetricError> {
    check_pair(
        ("grades of reader 1", first),
        ("grades of reader 2", second),
    )?;
    let weight = |a: f64, b: f64| match weights {
        KappaWeights::Equal => f64::from(u8::from(a != b)),
        KappaWeights::Linear => (a - b).abs(),
        KappaWeights::Quadratic => (a - b).powi(2),
    };
    let observed: f64 = first.iter().zip(second).map(|(&a, &b)| weight(a, b)).sum();
    let (first, second) = (frequencies(first), frequencies(second));
    let mut expected = 0.0;
    for &(a, of_a) in &first {
        for &(b, of_b) in &second {
            expected += of_a * of_b * weight(a, b);
        }
    }
    let count: f64 = first.iter().map(|(_, count)| count).sum();
    if expected == 0.0 {
        return Err(MetricError::Constant {
            what: "grades of both readers",
            count: count as usize,
            value: first[0].0,
        });
    }
    Ok(1.0 - count * observed / expected)
}

/// Each grade with its number of occurrences, ascending.
fn frequencies(grades: &[f64]) -> Vec<(f64, f64)> {
    let mut sorted = grades.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted
        .chunk_by(|a, b| a == b)
        .map(|equal| (equal[0], equal.len() as f64))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    /// Expected: `sklearn.metrics.cohen_kappa_score` 1.9.1 with all five half steps as labels.
    #[test]
    fn half_steps_weigh_as_in_scikit_learn() {
        let a = [1.0, 1.5, 3.0, 2.0, 2.5, 1.0, 2.0, 3.0];
        let b = [1.0, 2.0, 2.5, 2.0, 3.0, 1.5, 1.5, 3.0];
        for (weights, kappa) in [
            (KappaWeights::Equal, 0.215_686_274_509_803_93),
            (KappaWeights::Linear, 0.615_384_615_384_615_4),
            (KappaWeights::Quadratic, 0.848_484_848_484_848_5),
        ] {
            assert_abs_diff_eq!(
                weighted_kappa(&a, &b, weights).unwrap(),
                kappa,
                epsilon = 1e-14
            );
        }
        assert_eq!(weighted_kappa(&a, &a, KappaWeights::Linear), Ok(1.0));
    }

    #[test]
    fn one_grade_throughout_has_no_chance_agreement() {
        assert!(matches!(
            weighted_kappa(&[2.0, 2.0], &[2.0, 2.0], KappaWeights::Linear),
            Err(MetricError::Constant { .. })
        ));
        // If only one reader is constant, κ is 0: no better than chance.
        let chance = weighted_kappa(&[1.0, 2.0], &[2.0, 2.0], KappaWeights::Linear);
        assert_eq!(chance, Ok(0.0));
    }
}
