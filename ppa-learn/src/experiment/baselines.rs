//! Baselines without a network on the test sets of an experiment.

use std::fs::create_dir_all;

use ppa_dataset::layout::View;
use ppa_dataset::write_whole;
use serde::{Deserialize, Serialize};

use super::configuration::{Configuration, Variation};
use super::error::ExperimentError;
use super::predictions::{Prediction, join_views};
use super::record::{Record, file, fingerprint, read_json, without_paths};
use super::results::Results;
use super::run::Runner;
use super::training::Training;
use crate::PosePrediction;
use crate::evaluate::{BaselineKind, Row, baseline_predictions};
use crate::train::{TrainError, samples};

/// Content of the file with the baselines of one fold and view.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct OfView {
    /// Record of the settings and data used.
    record: Record,
    /// Standard deviation of each tested image's label.
    label_std: Vec<f64>,
    predictions: Vec<(BaselineKind, Vec<Prediction>)>,
}

impl Runner<'_> {
    /// Adds to the results the baselines of each fold, computed from all its training images without variants of the skin and cached in
    /// a file for each fold and view.
    ///
    /// # Errors
    /// [`ExperimentError`] naming the fold, or the file.
    pub fn add_baselines(&self, results: &mut Results) -> Result<(), ExperimentError> {
        for fold in 0..results.folds() {
            let [left, right] = View::ALL.map(|view| self.of_view(results, fold, view));
            let (left, right) = (left?, right?);
            let wrong = |source| ExperimentError::Predictions {
                place: self.place(fold),
                source,
            };
            for ((kind, left_view), (_, right_view)) in
                left.predictions.iter().zip(&right.predictions)
            {
                let joined = join_views(left_view, right_view).map_err(wrong)?;
                results
                    .insert_baseline(*kind, fold, &joined)
                    .map_err(wrong)?;
            }
            results.insert_label_std(left.label_std);
        }
        Ok(())
    }

    fn of_view(
        &self,
        results: &Results,
        fold: usize,
        view: View,
    ) -> Result<OfView, ExperimentError> {
        // Tested images are the same for all columns and seeds. The columns of a learning curve are compared with baselines of all data.
        let configuration = Configuration {
            variation: Variation::None,
            ..results.columns()[0]
        };
        let training = Training::Run {
            configuration,
            fold,
            view,
            seed: 1,
        };
        let named = |source: TrainError| ExperimentError::Training {
            training: self.place(fold),
            source: Box::new(source),
        };
        let config = self.config(training)?;
        let trained = samples(&config, &config.training).map_err(named)?;
        let tested = samples(&config, &config.evaluation).map_err(named)?;
        let data_sha256 = fingerprint(&[trained.clone(), tested.clone()]);
        let record = Record {
            config: without_paths(&config),
            start_sha256: None,
            data_sha256,
        };
        let folder = self.root().join(self.place(fold));
        let path = folder.join(format!("{}.json", view.name()));
        if path.exists() {
            let found: OfView = read_json(&path)?;
            return match found.record == record {
                true => Ok(found),
                false => Err(ExperimentError::OtherSettings(path)),
            };
        }
        let predicted = baseline_predictions(&trained, &tested)?;
        let rows = |(kind, predictions): (BaselineKind, Vec<f64>)| {
            let predictions: Vec<_> = predictions
                .into_iter()
                .map(PosePrediction::of_quality)
                .collect();
            let rows = Row::of(&tested, &predictions).into_iter();
            (kind, rows.map(Prediction::from).collect())
        };
        let of_view = OfView {
            record,
            label_std: tested.iter().map(|sample| sample.label_std).collect(),
            predictions: predicted.into_iter().map(rows).collect(),
        };
        create_dir_all(&folder).map_err(file("create", &folder))?;
        let text = serde_json::to_string(&of_view).expect("predictions are JSON");
        write_whole(&path, text.as_bytes())?;
        Ok(of_view)
    }

    fn place(&self, fold: usize) -> String {
        format!(
            "experiment_{}/baselines/fold_{fold}",
            self.experiment().name()
        )
    }
}
