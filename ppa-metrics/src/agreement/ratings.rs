//! Grades of several readers.

use crate::error::MetricError;

/// Table of grades: subjects (images) × readers; a grade may be missing.
#[derive(Debug, Clone, PartialEq)]
pub struct Ratings {
    readers: usize,
    rows: Vec<Vec<Option<f64>>>,
}

impl Ratings {
    /// Builds the table from one row per subject with one grade, or none, per reader.
    ///
    /// # Errors
    /// [`MetricError::TooFew`] for fewer than two subjects or readers, [`MetricError::Length`] for rows of different
    /// lengths, [`MetricError::NotFinite`] for a grade that is infinite or NaN.
    pub fn new(rows: Vec<Vec<Option<f64>>>) -> Result<Self, MetricError> {
        at_least_two("subjects", rows.len())?;
        let readers = rows[0].len();
        at_least_two("readers", readers)?;
        for (index, row) in rows.iter().enumerate() {
            if row.len() != readers {
                return Err(MetricError::Length {
                    first: "grades of the first subject",
                    first_count: readers,
                    second: "grades of another subject",
                    second_count: row.len(),
                });
            }
            if let Some(&found) = row.iter().flatten().find(|grade| !grade.is_finite()) {
                return Err(MetricError::NotFinite {
                    what: "grades of subject",
                    index,
                    found,
                });
            }
        }
        Ok(Self { readers, rows })
    }

    /// Number of readers.
    pub fn readers(&self) -> usize {
        self.readers
    }

    /// Number of subjects.
    pub fn subjects(&self) -> usize {
        self.rows.len()
    }

    /// The grades of each subject, in order.
    pub fn rows(&self) -> impl Iterator<Item = &[Option<f64>]> {
        self.rows.iter().map(Vec::as_slice)
    }

    /// The grades of the subjects that every reader graded, in order.
    pub fn complete_rows(&self) -> Vec<Vec<f64>> {
        let complete = |row: &Vec<Option<f64>>| row.iter().copied().collect();
        self.rows.iter().filter_map(complete).collect()
    }

    /// The grades that two readers gave to the subjects both graded.
    pub fn common(&self, first: usize, second: usize) -> (Vec<f64>, Vec<f64>) {
        let both = |row: &Vec<Option<f64>>| row[first].zip(row[second]);
        self.rows.iter().filter_map(both).unzip()
    }
}

/// Returns an error for fewer than two.
pub(super) fn at_least_two(what: &'static str, found: usize) -> Result<(), MetricError> {
    match found {
        0 | 1 => Err(MetricError::TooFew {
            what,
            found,
            expected: 2,
        }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_must_be_a_table_of_finite_grades() {
        let two = |row: Vec<Option<f64>>| Ratings::new(vec![vec![Some(1.0), None], row]);
        assert!(two(vec![None, Some(2.0)]).is_ok());
        assert!(matches!(
            two(vec![Some(2.0)]),
            Err(MetricError::Length { .. })
        ));
        assert_eq!(
            two(vec![Some(f64::INFINITY), None]),
            Err(MetricError::NotFinite {
                what: "grades of subject",
                index: 1,
                found: f64::INFINITY
            })
        );
        let few = |rows| Ratings::new(rows).unwrap_err().to_string();
        assert_eq!(
            few(vec![]),
            "the number of subjects is 0, expected at least 2"
        );
        let one_reader = vec![vec![Some(1.0)], vec![Some(2.0)]];
        assert_eq!(
            few(one_reader),
            "the number of readers is 1, expected at least 2"
        );
    }

    #[test]
    fn only_what_both_graded_is_common() {
        let ratings = Ratings::new(vec![
            vec![Some(1.0), Some(1.5), None],
            vec![Some(2.0), None, Some(2.5)],
            vec![Some(3.0), Some(2.5), Some(3.0)],
        ])
        .unwrap();
        assert_eq!(ratings.common(0, 1), (vec![1.0, 3.0], vec![1.5, 2.5]));
        assert_eq!(ratings.complete_rows(), [[3.0, 2.5, 3.0]]);
    }
}
