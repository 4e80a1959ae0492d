//! Comparison of the columns of a table with baselines, person by person.

use std::fmt;

use serde::Serialize;

use super::{Results, errors_of_persons};
use crate::evaluate::{BaselineKind, Compared, Verdict, p_network_better, sentence, verdict};
use crate::experiment::configuration::Configuration;
use crate::experiment::metric::Metric;

/// Comparison of a column with the baselines.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Headings of the column.
    pub column: String,
    /// Its mean absolute error.
    pub network_mae: f64,
    /// The baselines. Persons' errors are means over the column's seeds.
    pub baselines: Vec<Compared>,
    /// Number of persons of all folds; a person tested in several folds counts once.
    pub persons: usize,
    /// Whether the network is better.
    pub verdict: Verdict,
}

impl fmt::Display for Comparison {
    /// Writes the verdict in one or two sentences.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sentence = sentence(self.network_mae, &self.baselines, self.persons);
        write!(f, "{}: {sentence}", self.column)
    }
}

impl Results {
    /// Compares each column that has a complete seed with the baselines, if there are any.
    pub fn comparisons(&self) -> Vec<Comparison> {
        let kinds = self.baselines();
        let columns = self.columns.iter().filter(|_| !kinds.is_empty());
        columns
            .filter_map(|&column| self.comparison(column, &kinds))
            .collect()
    }

    fn comparison(&self, column: Configuration, kinds: &[BaselineKind]) -> Option<Comparison> {
        let network_mae = self.summary(column, Metric::Mae)?.mean;
        let of_network = self.errors_of_persons(column, &[column]);
        let compared = |&kind: &BaselineKind| {
            let folds = (0..self.folds).map(|fold| &self.baselines[&(kind, fold)]);
            Some(Compared {
                kind,
                mae: self.of_baseline(kind, Metric::Mae)?,
                p_network_better: p_network_better(&errors_of_persons(folds), &of_network),
            })
        };
        let baselines = kinds.iter().map(compared).collect::<Option<Vec<_>>>()?;
        Some(Comparison {
            column: column.headings().join(", "),
            network_mae,
            verdict: verdict(network_mae, &baselines),
            baselines,
            persons: of_network.len(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::test_set;
    use super::*;
    use crate::experiment::configuration::Experiment;
    use crate::experiment::predictions::Prediction;

    #[test]
    fn columns_are_compared_with_baselines_by_person() {
        let columns = Experiment::TwoC.configurations();
        let mut results = Results::new(Experiment::TwoC, columns, 2, &[1, 2]);
        // Errors of 0.25 and 0.5 for the two seeds, of persons 1 and 2 in the two folds.
        for place in results.missing() {
            let error = 0.25 * place.seed as f64;
            results
                .insert(place, &of_person(place.fold, error))
                .unwrap();
        }
        assert_eq!(results.comparisons(), []);
        for fold in 0..2 {
            let constant = of_person(fold, 0.5 + 0.25 * fold as f64);
            let kind = BaselineKind::Constant;
            results.insert_baseline(kind, fold, &constant).unwrap();
        }
        // A baseline of one fold only is not compared.
        let angle = of_person(0, 0.125);
        results
            .insert_baseline(BaselineKind::Angle, 0, &angle)
            .unwrap();
        assert_eq!(
            results.of_baseline(BaselineKind::Constant, Metric::Mae),
            Some(0.625)
        );
        let found = &results.comparisons()[0];
        assert_eq!((found.network_mae, found.persons), (0.375, 2));
        let [constant] = found.baselines[..] else {
            panic!("{found:?}")
        };
        // 0.5 and 0.75 against 0.375 for both: the most extreme of the four sign patterns.
        assert_eq!((constant.mae, constant.p_network_better), (0.625, 0.25));
        assert_eq!(found.verdict, Verdict::NotShown);
    }

    /// The test set of one person for each fold.
    fn of_person(fold: usize, error: f64) -> Vec<Prediction> {
        let mut rows = test_set(error);
        rows.iter_mut()
            .for_each(|row| row.patient = 1 + fold as u32);
        rows
    }
}
