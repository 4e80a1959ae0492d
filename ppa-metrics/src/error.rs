//! Why a metric has no value.

/// Why a metric has no value.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MetricError {
    /// Nothing to average.
    #[error("no {0}: a metric needs at least one")]
    Empty(&'static str),
    /// Two lists that belong together have different lengths.
    #[error("expected as many {first} as {second}, found {first_count} and {second_count}")]
    Length {
        /// Content of the first list.
        first: &'static str,
        /// Its length.
        first_count: usize,
        /// Content of the second list.
        second: &'static str,
        /// Its length.
        second_count: usize,
    },
    /// Too few of something.
    #[error("the number of {what} is {found}, expected at least {expected}")]
    TooFew {
        /// What there are too few of.
        what: &'static str,
        /// Number found.
        found: usize,
        /// Number required.
        expected: usize,
    },
    /// A value is infinite or NaN.
    #[error("{what} {index} is {found}, expected a finite number")]
    NotFinite {
        /// Which list.
        what: &'static str,
        /// Position in it, from 0.
        index: usize,
        /// The value.
        found: f64,
    },
    /// A grade below 0 where grades are compared by their ratio.
    #[error("a grade is {found}, expected 0 or more: ratios need an absolute zero")]
    BelowZero {
        /// The lowest grade.
        found: f64,
    },
    /// All values are the same, so the correlation is undefined.
    #[error("all {count} {what} are {value}: a correlation needs two different values")]
    Constant {
        /// Which list.
        what: &'static str,
        /// Its length.
        count: usize,
        /// The value.
        value: f64,
    },
    /// No label is non-diagnostic, so sensitivity is undefined.
    #[error("no label is non-diagnostic (2.5 or above), so sensitivity is not defined")]
    NoPositives,
    /// No label is diagnostic, so specificity is undefined.
    #[error("no label is diagnostic (below 2.5), so specificity is not defined")]
    NoNegatives,
    /// A seed with more or fewer folds than the first.
    #[error(
        "the number of rows of seed {seed} is {found}, expected {expected} as for the first seed"
    )]
    UnequalFolds {
        /// The seed.
        seed: u64,
        /// Number of its rows.
        found: usize,
        /// Number of rows of the first seed.
        expected: usize,
    },
    /// More pairs than the exact test supports.
    #[error("{found} pairs, expected at most {max}: the exact test counts all 2^n sign patterns")]
    TooManyPairs {
        /// Pairs found.
        found: usize,
        /// Largest number supported.
        max: usize,
    },
}

/// Returns an error for an empty list and for values that are not finite.
pub(crate) fn check_values(what: &'static str, values: &[f64]) -> Result<(), MetricError> {
    if values.is_empty() {
        return Err(MetricError::Empty(what));
    }
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(MetricError::NotFinite {
            what,
            index,
            found: values[index],
        }),
        None => Ok(()),
    }
}

/// [`check_values`] of two lists, which must have the same length.
pub(crate) fn check_pair(
    first: (&'static str, &[f64]),
    second: (&'static str, &[f64]),
) -> Result<(), MetricError> {
    if first.1.len() != second.1.len() {
        return Err(MetricError::Length {
            first: first.0,
            first_count: first.1.len(),
            second: second.0,
            second_count: second.1.len(),
        });
    }
    check_values(first.0, first.1)?;
    check_values(second.0, second.1)
}

/// [`check_pair`] of labels and predictions.
pub(crate) fn check_scores(labels: &[f64], predictions: &[f64]) -> Result<(), MetricError> {
    check_pair(("labels", labels), ("predictions", predictions))
}
