//! Each reader compared with the others and with themselves, and the images on which readers differ most.

use serde::Serialize;

use super::ratings::Ratings;
use crate::error::{MetricError, check_pair};

/// Difference of one reader from the mean of the others, over the subjects that this reader and another graded.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ReaderError {
    /// Number of these subjects.
    pub subjects: usize,
    /// Mean of grade − mean of the others: above 0 for a strict reader, since 3 is inadequate.
    pub bias: f64,
    /// Mean of |grade − mean of the others|: the error that a computed label has to beat.
    pub mae: f64,
}

/// Returns one [`ReaderError`] per reader, `None` for one who shares no subject with another.
pub fn reader_errors(ratings: &Ratings) -> Vec<Option<ReaderError>> {
    let of_reader = |reader: usize| {
        let differences: Vec<f64> = ratings
            .rows()
            .filter_map(|row| {
                let others = row.iter().enumerate().filter(|&(other, _)| other != reader);
                let others: Vec<f64> = others.filter_map(|(_, &grade)| grade).collect();
                let mean = others.iter().sum::<f64>() / others.len() as f64;
                row[reader].filter(|_| !others.is_empty()).map(|g| g - mean)
            })
            .collect();
        let n = differences.len() as f64;
        (!differences.is_empty()).then(|| ReaderError {
            subjects: differences.len(),
            bias: differences.iter().sum::<f64>() / n,
            mae: differences.iter().map(|d| d.abs()).sum::<f64>() / n,
        })
    };
    (0..ratings.readers()).map(of_reader).collect()
}

/// Agreement of a reader with themselves on images shown twice.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RepeatAgreement {
    /// Images shown twice.
    pub images: usize,
    /// Share of images with the same grade twice.
    pub equal: f64,
    /// Mean of |second − first|.
    pub mae: f64,
}

/// Compares first and second grade of each repeated image.
///
/// # Errors
/// [`MetricError`] for empty, unequal or non-finite input.
pub fn repeat_agreement(first: &[f64], second: &[f64]) -> Result<RepeatAgreement, MetricError> {
    check_pair(("first grades", first), ("second grades", second))?;
    let images = first.len();
    let differences = || first.iter().zip(second).map(|(a, b)| (b - a).abs());
    Ok(RepeatAgreement {
        images,
        equal: differences().filter(|&d| d == 0.0).count() as f64 / images as f64,
        mae: differences().sum::<f64>() / images as f64,
    })
}

/// A subject on which readers differ.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Disagreement {
    /// Its row, from 0.
    pub subject: usize,
    /// Best grade.
    pub lowest: f64,
    /// Worst grade.
    pub highest: f64,
    /// Standard deviation over the readers, dividing by their number as the published labels do.
    pub std: f64,
}

/// The subjects with different grades, by widest range, then largest standard deviation, then first row.
pub fn disagreements(ratings: &Ratings) -> Vec<Disagreement> {
    let mut found: Vec<Disagreement> = ratings
        .rows()
        .enumerate()
        .filter_map(|(subject, row)| {
            let grades: Vec<f64> = row.iter().flatten().copied().collect();
            let lowest = grades.iter().copied().reduce(f64::min)?;
            let highest = grades.iter().copied().reduce(f64::max)?;
            let n = grades.len() as f64;
            let mean = grades.iter().sum::<f64>() / n;
            let variance = grades.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / n;
            (highest > lowest).then(|| Disagreement {
                subject,
                lowest,
                highest,
                std: variance.sqrt(),
            })
        })
        .collect();
    let width = |d: &Disagreement| d.highest - d.lowest;
    // The sort is stable: equal ones keep the order of their rows.
    found.sort_by(|a, b| {
        let by_width = width(b).total_cmp(&width(a));
        by_width.then(b.std.total_cmp(&a.std))
    });
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ratings() -> Ratings {
        Ratings::new(vec![
            vec![Some(1.0), Some(1.0), Some(2.0), None],
            vec![Some(2.0), Some(2.5), Some(3.0), None],
            vec![Some(3.0), Some(3.0), None, None],
            vec![None, None, Some(1.0), None],
            vec![Some(1.0), Some(2.0), Some(2.0), None],
        ])
        .unwrap()
    }

    #[test]
    fn bias_is_against_the_mean_of_the_others() {
        let errors = reader_errors(&ratings());
        let first = errors[0].unwrap();
        // 1 − 1.5, 2 − 2.75, 3 − 3, 1 − 2
        assert_eq!(
            (first.subjects, first.bias, first.mae),
            (4, -0.5625, 0.5625)
        );
        let third = errors[2].unwrap();
        // 2 − 1, 3 − 2.25, 2 − 1.5; an image graded only by this reader does not count
        assert_eq!((third.subjects, third.bias), (3, 0.75));
        assert_eq!(errors[3], None);
    }

    #[test]
    fn widest_disagreement_first() {
        let found = disagreements(&ratings());
        let order: Vec<usize> = found.iter().map(|d| d.subject).collect();
        assert_eq!(order, [0, 4, 1]);
        assert_eq!((found[2].lowest, found[2].highest), (2.0, 3.0));
        // Published example: {1, 1.5, 1.5, 2} has mean 1.5 and std 0.35355.
        let published = Ratings::new(vec![vec![Some(1.0), Some(1.5), Some(1.5), Some(2.0)]; 2]);
        let std = disagreements(&published.unwrap())[0].std;
        assert!((std - 0.353_55).abs() < 5e-6);
    }

    #[test]
    fn repeats() {
        let repeats = repeat_agreement(&[1.0, 2.0, 3.0, 1.5], &[1.0, 2.5, 3.0, 1.0]).unwrap();
        assert_eq!((repeats.images, repeats.equal, repeats.mae), (4, 0.5, 0.25));
        assert!(repeat_agreement(&[], &[]).is_err());
    }
}
