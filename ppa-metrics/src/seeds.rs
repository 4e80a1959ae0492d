//! One pair of values per seed, from the folds of each.

use std::collections::BTreeMap;

use crate::error::{MetricError, check_pair};

/// Means of a and b over the rows of each seed, ascending by seed.
///
/// The folds of one cross-validation are parts of the same evaluation, not independent observations: the paper
/// averages them within each seed before it tests the seeds (section 5.1).
///
/// # Errors
/// [`MetricError`] for empty, unequal or non-finite input, and if the seeds have different numbers of rows: one of
/// them would then be the mean of other folds.
pub fn mean_per_seed(
    seeds: &[u64],
    a: &[f64],
    b: &[f64],
) -> Result<(Vec<f64>, Vec<f64>), MetricError> {
    check_pair(("values in a", a), ("values in b", b))?;
    if seeds.len() != a.len() {
        return Err(MetricError::Length {
            first: "seeds",
            first_count: seeds.len(),
            second: "pairs",
            second_count: a.len(),
        });
    }
    let mut of_seed: BTreeMap<u64, Vec<usize>> = BTreeMap::new();
    for (row, &seed) in seeds.iter().enumerate() {
        of_seed.entry(seed).or_default().push(row);
    }
    let expected = of_seed.values().next().map_or(0, Vec::len);
    if let Some((&seed, rows)) = of_seed.iter().find(|(_, rows)| rows.len() != expected) {
        return Err(MetricError::UnequalFolds {
            seed,
            found: rows.len(),
            expected,
        });
    }
    let mean = |values: &[f64], rows: &[usize]| {
        rows.iter().map(|&row| values[row]).sum::<f64>() / rows.len() as f64
    };
    Ok(of_seed
        .values()
        .map(|rows| (mean(a, rows), mean(b, rows)))
        .unzip())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folds_are_averaged_whatever_their_order() {
        let seeds = [2, 1, 1, 2];
        let found = mean_per_seed(&seeds, &[1.0, 2.0, 4.0, 2.0], &[0.5, 1.0, 2.0, 0.5]);
        assert_eq!(found, Ok((vec![3.0, 1.5], vec![1.5, 0.5])));
    }

    #[test]
    fn a_missing_fold_is_an_error() {
        assert_eq!(
            mean_per_seed(&[1, 1, 2], &[1.0; 3], &[1.0; 3]),
            Err(MetricError::UnequalFolds {
                seed: 2,
                found: 1,
                expected: 2
            })
        );
        let found = mean_per_seed(&[1], &[1.0; 2], &[1.0; 2]);
        assert!(matches!(found, Err(MetricError::Length { .. })));
    }
}
