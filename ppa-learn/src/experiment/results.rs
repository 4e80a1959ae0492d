//! Metrics of an experiment's runs, collected over views, folds and seeds.

mod comparison;
mod difference;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use ppa_metrics::{
    ConstantPrediction, MetricError, PermutationTest, constant_prediction, sign_flip_permutation,
};
use serde::Serialize;

use super::configuration::{Configuration, Experiment};
use super::metric::Metric;
use super::predictions::{Prediction, PredictionError};
use crate::evaluate::{BaselineKind, label_noise_mae, mean_by, means};
pub use comparison::Comparison;
pub use difference::Difference;

/// Metrics of each column's test sets.
///
/// The folds of one seed are averaged first, as in the paper's test; mean and standard deviation are taken over the seeds.
#[derive(Debug, Clone)]
pub struct Results {
    experiment: Experiment,
    columns: Vec<Configuration>,
    folds: usize,
    seeds: Vec<u64>,
    values: BTreeMap<(Configuration, u64, usize), TestSet>,
    baselines: BTreeMap<(BaselineKind, usize), TestSet>,
    label_std: Vec<f64>,
    not_finite: BTreeSet<Missing>,
    constant: BTreeMap<Missing, ConstantPrediction>,
}

/// Metrics of the predictions on one fold.
#[derive(Debug, Clone)]
struct TestSet {
    metrics: BTreeMap<Metric, Option<f64>>,
    predictions: Vec<Prediction>,
}

/// A test set without usable predictions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Missing {
    /// The column.
    pub configuration: Configuration,
    /// The repetition.
    pub seed: u64,
    /// The fold, from 0.
    pub fold: usize,
}

/// Mean and standard deviation over the seeds of a column.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Summary {
    /// Mean over the seeds.
    pub mean: f64,
    /// Standard deviation over the seeds, with the divisor n - 1; `None` for a single seed.
    pub std: Option<f64>,
    /// Number of seeds with all folds and a defined metric.
    pub seeds: usize,
    /// Number of seeds with all folds whose metric is not defined.
    pub undefined: usize,
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            configuration,
            seed,
            fold,
        } = self;
        let (experiment, column) = (configuration.experiment.name(), configuration.name());
        write!(
            f,
            "experiment {experiment}, column {column}, seed {seed}, fold {fold}"
        )
    }
}

impl Results {
    /// Makes empty results for the columns of an experiment that are run, with `folds` folds and these seeds.
    pub fn new(
        experiment: Experiment,
        columns: Vec<Configuration>,
        folds: usize,
        seeds: &[u64],
    ) -> Self {
        Self {
            experiment,
            columns,
            folds,
            seeds: seeds.to_vec(),
            values: BTreeMap::new(),
            baselines: BTreeMap::new(),
            label_std: Vec::new(),
            not_finite: BTreeSet::new(),
            constant: BTreeMap::new(),
        }
    }

    /// Adds the joined predictions of one test set. A test set with a prediction that is not finite stays missing, and
    /// [`Results::not_finite`] names it.
    ///
    /// # Errors
    /// [`PredictionError`] for predictions that cannot be evaluated.
    pub fn insert(
        &mut self,
        place: Missing,
        predictions: &[Prediction],
    ) -> Result<(), PredictionError> {
        if predictions.iter().any(|row| !row.prediction.is_finite()) {
            self.not_finite.insert(place);
            return Ok(());
        }
        let test_set = self.test_set(predictions)?;
        let labels: Vec<_> = predictions.iter().map(|row| row.label).collect();
        let answers: Vec<_> = predictions.iter().map(|row| row.prediction).collect();
        if let Some(constant) = constant_prediction(&labels, &answers)? {
            self.constant.insert(place, constant);
        }
        let key = (place.configuration, place.seed, place.fold);
        self.values.insert(key, test_set);
        Ok(())
    }

    /// Adds the joined predictions of a baseline for one fold.
    ///
    /// # Errors
    /// [`PredictionError`] for predictions that cannot be evaluated.
    pub fn insert_baseline(
        &mut self,
        kind: BaselineKind,
        fold: usize,
        predictions: &[Prediction],
    ) -> Result<(), PredictionError> {
        let test_set = self.test_set(predictions)?;
        self.baselines.insert((kind, fold), test_set);
        Ok(())
    }

    /// Adds the standard deviations of tested labels.
    pub fn insert_label_std(&mut self, label_std: Vec<f64>) {
        self.label_std.extend(label_std);
    }

    fn test_set(&self, predictions: &[Prediction]) -> Result<TestSet, PredictionError> {
        let metrics = Metric::of(self.experiment).into_iter();
        let metrics = metrics.map(|metric| Ok((metric, metric.value(predictions)?)));
        Ok(TestSet {
            metrics: metrics.collect::<Result<_, PredictionError>>()?,
            predictions: predictions.to_vec(),
        })
    }

    /// Returns the experiment.
    pub fn experiment(&self) -> Experiment {
        self.experiment
    }

    /// Returns the columns that are run.
    pub fn columns(&self) -> &[Configuration] {
        &self.columns
    }

    /// Returns the number of planned seeds.
    pub fn planned_seeds(&self) -> usize {
        self.seeds.len()
    }

    /// Returns the test sets with predictions that are not finite: their training runs diverged.
    pub fn not_finite(&self) -> &BTreeSet<Missing> {
        &self.not_finite
    }

    /// Returns the test sets for which the network predicts a constant, and that constant.
    pub fn constant(&self) -> &BTreeMap<Missing, ConstantPrediction> {
        &self.constant
    }

    /// Returns whether no test set has been evaluated yet.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Returns the number of folds of each seed.
    pub fn folds(&self) -> usize {
        self.folds
    }

    /// Returns the test sets without usable predictions.
    pub fn missing(&self) -> Vec<Missing> {
        let mut missing = Vec::new();
        for &configuration in &self.columns {
            for &seed in &self.seeds {
                for fold in 0..self.folds {
                    if !self.values.contains_key(&(configuration, seed, fold)) {
                        missing.push(Missing {
                            configuration,
                            seed,
                            fold,
                        });
                    }
                }
            }
        }
        missing
    }

    /// Returns the mean of a metric over the folds of one seed. `None` if a fold is missing, `Some(None)` if the metric is not defined.
    fn of_seed(&self, column: Configuration, metric: Metric, seed: u64) -> Option<Option<f64>> {
        let folds = (0..self.folds).map(|fold| self.values.get(&(column, seed, fold)));
        let folds = folds.collect::<Option<Vec<_>>>()?;
        let values: Option<Vec<f64>> = folds.iter().map(|set| set.metrics[&metric]).collect();
        Some(values.map(|values| mean(&values)))
    }

    /// Returns the mean absolute error of each person, over the seeds that are complete in all columns of `complete_in`.
    fn errors_of_persons(&self, column: Configuration, complete_in: &[Configuration]) -> Vec<f64> {
        let complete = |seed: &&u64| {
            let mut columns = complete_in.iter();
            columns.all(|&column| self.of_seed(column, Metric::Mae, **seed).is_some())
        };
        let seeds = self.seeds.iter().filter(complete);
        let sets = seeds.flat_map(|&seed| {
            (0..self.folds).filter_map(move |fold| self.values.get(&(column, seed, fold)))
        });
        errors_of_persons(sets)
    }

    /// Returns mean and standard deviation over the seeds of a column; `None` if no seed has a value.
    pub fn summary(&self, column: Configuration, metric: Metric) -> Option<Summary> {
        let there = self.seeds.iter();
        let there: Vec<_> = there
            .filter_map(|&seed| self.of_seed(column, metric, seed))
            .collect();
        let values: Vec<_> = there.iter().copied().flatten().collect();
        (!values.is_empty()).then(|| Summary {
            mean: mean(&values),
            std: standard_deviation(&values),
            seeds: values.len(),
            undefined: there.len() - values.len(),
        })
    }

    /// Returns the predictions of a column in the order of moments, averaged over the available seeds and, for a moment that several
    /// folds test, over the folds.
    pub fn mean_predictions(&self, column: Configuration) -> Vec<Prediction> {
        let sets = self.values.iter().filter(|(key, _)| key.0 == column);
        let rows: Vec<&Prediction> = sets.flat_map(|(_, set)| &set.predictions).collect();
        let means = mean_by(rows.iter().map(|row| (row.moment(), row.prediction)));
        let of_moment: BTreeMap<_, _> = rows.iter().map(|&row| (row.moment(), row)).collect();
        let mean = |(row, prediction): (&Prediction, f64)| Prediction {
            prediction,
            ..row.clone()
        };
        let both = of_moment.into_values().zip(means.into_values());
        both.map(mean).collect()
    }

    /// Returns (degrees, mean absolute error, predictions) of each angle that the dataset states, over the seeds and folds of a column.
    pub fn error_by_angle(&self, column: Configuration) -> Vec<(f64, f64, usize)> {
        let sets = self.values.iter().filter(|(key, _)| key.0 == column);
        let rows = sets.flat_map(|(_, set)| &set.predictions);
        means(rows.filter_map(|row| Some((row.angle_deg?, (row.label - row.prediction).abs()))))
    }

    /// Returns the baselines that are available for every fold.
    pub fn baselines(&self) -> Vec<BaselineKind> {
        let of_first = self.baselines.keys().filter(|(_, fold)| *fold == 0);
        let kinds = of_first.map(|&(kind, _)| kind);
        let all = |kind: &BaselineKind| {
            (0..self.folds).all(|fold| self.baselines.contains_key(&(*kind, fold)))
        };
        kinds.filter(all).collect()
    }

    /// Returns the mean over the folds of a baseline, which has no seeds; `None` if the metric is not defined.
    pub fn of_baseline(&self, kind: BaselineKind, metric: Metric) -> Option<f64> {
        let folds = (0..self.folds).map(|fold| self.baselines.get(&(kind, fold))?.metrics[&metric]);
        Some(mean(&folds.collect::<Option<Vec<_>>>()?))
    }

    /// Returns the mean absolute error of labels that are normally distributed with their standard deviation; `None` if all are 0.
    pub fn label_noise_mae(&self) -> Option<f64> {
        label_noise_mae(self.label_std.iter().copied())
    }

    /// Runs the paper's test of the MAE, from scratch against pretrained, paired by seed; the folds of a seed are averaged
    /// first. `None` for experiments without such a test.
    ///
    /// # Errors
    /// [`MetricError`] if no seed is complete in both columns, or too many are.
    pub fn permutation_test(&self) -> Option<Result<PermutationTest, MetricError>> {
        let pair = self.experiment.tested_pair()?;
        let both = |&seed: &u64| {
            let [scratch, pretrained] =
                pair.map(|column| self.of_seed(column, Metric::Mae, seed).flatten());
            Some((scratch?, pretrained?))
        };
        let (scratch, pretrained): (Vec<_>, Vec<_>) = self.seeds.iter().filter_map(both).unzip();
        Some(sign_flip_permutation(&scratch, &pretrained))
    }
}

/// Returns the mean absolute error of each person over test sets, in the order of persons.
fn errors_of_persons<'a>(sets: impl Iterator<Item = &'a TestSet>) -> Vec<f64> {
    let rows = sets.flat_map(|set| &set.predictions);
    let errors = rows.map(|row| (row.patient, (row.label - row.prediction).abs()));
    mean_by(errors).into_values().collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn standard_deviation(values: &[f64]) -> Option<f64> {
    let mean = mean(values);
    let squares = values.iter().map(|value| (value - mean).powi(2));
    (values.len() > 1).then(|| (squares.sum::<f64>() / (values.len() - 1) as f64).sqrt())
}

#[cfg(test)]
pub(super) mod tests {
    use approx::assert_relative_eq;
    use ppa_dataset::layout::Side;

    use super::super::table::Table;
    use super::*;

    pub(in super::super) fn test_set(error: f64) -> Vec<Prediction> {
        let row = |pose: &str, label: f64, prediction: f64| Prediction {
            patient: 1,
            side: Side::Right,
            pose: pose.to_owned(),
            frame: 0,
            angle_deg: None,
            label,
            prediction,
        };
        vec![row("a", 1.0, 1.0 + error), row("b", 3.0, 3.0 - error)]
    }

    #[test]
    fn folds_are_averaged_before_seeds() {
        let seeds = [7, 8, 9];
        let columns = Experiment::TwoA.configurations();
        let mut results = Results::new(Experiment::TwoA, columns, 2, &seeds);
        let [scratch, pretrained] = Experiment::TwoA.tested_pair().unwrap();
        for (configuration, worse) in [(scratch, 0.125), (pretrained, 0.0)] {
            for (n, &seed) in seeds.iter().enumerate() {
                for fold in 0..2 {
                    if n == 2 && fold == 1 {
                        continue;
                    }
                    let place = Missing {
                        configuration,
                        seed,
                        fold,
                    };
                    let error = 0.125 + worse + 0.25 * fold as f64 + 0.125 * n as f64;
                    results.insert(place, &test_set(error)).unwrap();
                }
            }
        }
        // Two complete seeds, 0.25 and 0.375; the third lacks a fold.
        let found = results.summary(pretrained, Metric::Mae).unwrap();
        assert_eq!((found.mean, found.seeds, found.undefined), (0.3125, 2, 0));
        assert_relative_eq!(
            found.std.unwrap(),
            0.125 / 2f64.sqrt(),
            max_relative = 1e-12
        );

        let test = results.permutation_test().unwrap().unwrap();
        assert_eq!((test.mean_difference, test.patterns), (0.125, 4));
        assert_eq!(test.p_one_sided, 0.25);

        assert_eq!(results.missing().len(), 2 + 8 * 6);
    }

    #[test]
    fn a_constant_prediction_has_no_correlation() {
        let columns = Experiment::TwoC.configurations();
        let configuration = columns[0];
        let mut results = Results::new(Experiment::TwoC, columns, 1, &[1]);
        let place = results.missing()[0];
        results.insert(place, &test_set(1.0)).unwrap();
        assert_eq!(results.summary(configuration, Metric::Correlation), None);
        let mae = results.summary(configuration, Metric::Mae).unwrap();
        assert_eq!((mae.mean, mae.std), (1.0, None));
        assert_eq!(results.constant()[&place].mean, 2.0);
        let table = Table::so_far(&results).to_markdown();
        let first = table.lines().next().unwrap();
        assert!(
            first.starts_with("Constant predictions: on 1 of 1 test set "),
            "{table}"
        );
        assert!(first.contains("column scratch 1 of 1"), "{table}");
    }

    #[test]
    fn a_run_that_is_not_finite_is_named_and_stays_missing() {
        let columns = Experiment::TwoC.configurations();
        let mut results = Results::new(Experiment::TwoC, columns, 1, &[1]);
        let missing = results.missing();
        for &place in &missing[1..] {
            results.insert(place, &test_set(0.25)).unwrap();
        }
        results.insert(missing[0], &test_set(f64::NAN)).unwrap();
        assert_eq!(results.missing(), [missing[0]]);
        let refused = Table::complete(&results).unwrap_err().to_string();
        let place = missing[0].to_string();
        let expected = format!(
            "1 test set is missing, the first is {place}; not all predictions of {place} are finite"
        );
        assert_eq!(refused, expected);
        let table = Table::so_far(&results).to_markdown();
        let note = format!("Left out: {place}, whose predictions are not all finite.");
        assert!(table.contains(&note) && table.contains("0.25"), "{table}");
    }
}
