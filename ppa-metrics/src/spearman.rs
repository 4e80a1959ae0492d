//! Rank correlation.

use crate::error::{MetricError, check_scores};

/// Spearman's rank correlation: Pearson's coefficient of the ranks, equal values sharing their mean rank.
///
/// Without equal values this is the paper's 1 − 6 Σ d² / (N (N² − 1)); with ties, which quality labels always have, that
/// formula is inaccurate, and this function gives the result of SciPy's `spearmanr`.
///
/// # Errors
/// [`MetricError::Constant`] if either list has only one distinct value; empty, unequal or non-finite input.
pub fn spearman(labels: &[f64], predictions: &[f64]) -> Result<f64, MetricError> {
    check_scores(labels, predictions)?;
    for (what, values) in [("labels", labels), ("predictions", predictions)] {
        if values.iter().all(|value| *value == values[0]) {
            return Err(MetricError::Constant {
                what,
                count: values.len(),
                value: values[0],
            });
        }
    }
    let (x, y) = (centred_ranks(labels), centred_ranks(predictions));
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    // One root of the product: lists in the same order give exactly 1.
    Ok((dot(&x, &y) / (dot(&x, &x) * dot(&y, &y)).sqrt()).clamp(-1.0, 1.0))
}

/// Mid-ranks minus their mean (N + 1)/2; multiples of one half, so exact.
fn centred_ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_unstable_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    let mut start = 0;
    for ties in order.chunk_by(|&a, &b| values[a] == values[b]) {
        let end = start + ties.len();
        // Ranks start + 1 … end, shared.
        let mid_rank = 0.5 * (start + 1 + end) as f64;
        for &index in ties {
            ranks[index] = mid_rank - 0.5 * (values.len() + 1) as f64;
        }
        start = end;
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use proptest::prelude::*;

    /// `scipy.stats.spearmanr(x, y).statistic`, SciPy 1.17.1.
    #[test]
    fn ties_share_their_mean_rank_as_in_scipy() {
        let labels = [1.0, 1.0, 1.5, 2.0, 2.0, 2.0, 2.5, 3.0, 3.0, 1.5];
        let predictions = [1.1, 0.9, 1.6, 1.8, 2.4, 1.8, 2.2, 2.9, 2.2, 2.0];
        assert_abs_diff_eq!(
            spearman(&labels, &predictions).unwrap(),
            0.844_339_193_914_791,
            epsilon = 1e-14
        );
        let (x, y) = (
            [1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
            [2.0, 1.0, 4.0, 3.0, 6.0, 5.0],
        );
        assert_abs_diff_eq!(
            spearman(&x, &y).unwrap(),
            0.828_571_428_571_428_7,
            epsilon = 1e-14
        );
    }

    proptest! {
        /// Without ties the paper's formula holds; a monotone map changes nothing; a reversal changes the sign.
        #[test]
        fn the_papers_formula_without_ties(order in Just((0..12_i32).collect::<Vec<_>>()).prop_shuffle()) {
            let x: Vec<f64> = (0..12).map(f64::from).collect();
            let y: Vec<f64> = order.iter().map(|&rank| f64::from(rank).exp()).collect();
            let squares: i32 = order.iter().enumerate().map(|(i, &rank)| (i as i32 - rank).pow(2)).sum();
            let formula = 1.0 - 6.0 * f64::from(squares) / (12.0 * 143.0);
            let rho = spearman(&x, &y).unwrap();
            prop_assert!((rho - formula).abs() < 1e-14);
            let reversed: Vec<f64> = y.iter().map(|y| -y).collect();
            prop_assert!((spearman(&x, &reversed).unwrap() + rho).abs() < 1e-14);
        }
    }

    #[test]
    fn constant_input_has_no_order() {
        let constant = spearman(&[2.0, 2.0, 2.0], &[1.0, 2.0, 3.0]);
        assert_eq!(
            constant,
            Err(MetricError::Constant {
                what: "labels",
                count: 3,
                value: 2.0
            })
        );
        assert!(matches!(
            spearman(&[1.0], &[1.0]),
            Err(MetricError::Constant { .. })
        ));
        assert!(matches!(
            spearman(&[0.0, 1.0], &[0.0, -0.0]),
            Err(MetricError::Constant {
                what: "predictions",
                ..
            })
        ));
    }
}
