//! Comparison of the columns of a table with its first one, person by person.

use std::fmt;

use ppa_core::text::count;
use serde::Serialize;

use super::Results;
use crate::evaluate::test_of_persons;
use crate::experiment::configuration::{Configuration, Experiment};

/// Difference between the mean absolute errors of a column and of the table's first column.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// Headings of the column.
    pub column: String,
    /// Headings of the first column.
    pub reference: String,
    /// Mean over the persons of the column's mean absolute error minus the first column's, over the seeds that both have.
    pub mae_difference: f64,
    /// p-value of an exact two-sided sign-flip test over the persons.
    pub p_two_sided: f64,
    /// Number of persons of all folds.
    pub persons: usize,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            column,
            reference,
            mae_difference,
            p_two_sided,
            persons,
        } = self;
        let persons = count(*persons, "person");
        write!(
            f,
            "{column} compared with {reference}: MAE {mae_difference:+.3}, two-sided p "
        )?;
        match *p_two_sided < 0.0005 {
            true => write!(f, "< 0.001 over {persons}."),
            false => write!(f, "= {p_two_sided:.3} over {persons}."),
        }
    }
}

impl Results {
    /// Compares each column with the first one, in experiments that change one thing at a time: 1, body shapes and ablations. Columns
    /// without a complete seed in common with the first are left out.
    pub fn differences(&self) -> Vec<Difference> {
        use Experiment::{Ablations, One, Shapes};
        let alters = matches!(self.experiment, One | Shapes | Ablations);
        match self.columns[..] {
            [reference, ref others @ ..] if alters => others
                .iter()
                .filter_map(|&column| self.difference(column, reference))
                .collect(),
            _ => Vec::new(),
        }
    }

    fn difference(&self, column: Configuration, reference: Configuration) -> Option<Difference> {
        let both = [column, reference];
        let [own, of_reference] = both.map(|one| self.errors_of_persons(one, &both));
        let test = test_of_persons(&own, &of_reference)?;
        let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
        let [column, reference] = both.map(|one| one.headings().join(", "));
        Some(Difference {
            column,
            reference,
            mae_difference: mean(&own) - mean(&of_reference),
            p_two_sided: test.p_two_sided,
            persons: own.len(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::test_set;
    use super::*;

    #[test]
    fn columns_are_paired_by_person_over_common_seeds() {
        let columns = Experiment::Shapes.configurations();
        let mut results = Results::new(Experiment::Shapes, columns.clone(), 3, &[1, 2]);
        for place in results.missing() {
            // Seed 2 of the first column lacks a fold, so that only seed 1 counts.
            let is_first = place.configuration == columns[0];
            if (is_first && place.seed == 2 && place.fold == 0) || place.configuration == columns[2]
            {
                continue;
            }
            let error = if is_first {
                0.5
            } else {
                0.25 * place.seed as f64
            };
            let mut rows = test_set(error);
            rows.iter_mut()
                .for_each(|row| row.patient = place.fold as u32);
            results.insert(place, &rows).unwrap();
        }
        let found = results.differences();
        let columns: Vec<_> = found.iter().map(|one| &*one.column).collect();
        assert_eq!(columns, ["size aug.", "all aug."]);
        // All three persons' errors fall by 0.25: two of the eight sign patterns are as far from 0.
        assert_eq!((found[0].mae_difference, found[0].persons), (-0.25, 3));
        assert_eq!(found[0].p_two_sided, 0.25);
        assert_eq!(
            found[0].to_string(),
            "size aug. compared with without aug.: MAE -0.250, two-sided p = 0.250 over 3 persons."
        );
        let surely = Difference {
            p_two_sided: 1e-9,
            ..found[0].clone()
        };
        assert!(surely.to_string().ends_with("p < 0.001 over 3 persons."));
        let other = Experiment::TwoA.configurations();
        let results = Results::new(Experiment::TwoA, other, 2, &[1]);
        assert_eq!(results.differences(), []);
    }
}
