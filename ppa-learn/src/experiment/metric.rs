//! The rows of the paper's tables.

use ppa_metrics as metrics;

use super::configuration::Experiment;
use super::predictions::{Prediction, PredictionError, pose_triples};

/// A row of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Metric {
    /// Mean absolute error.
    Mae,
    /// Spearman's rank correlation.
    Correlation,
    /// Pose delta, experiment 2b only.
    PoseDelta,
    /// Pose margin accuracy, experiment 2b only.
    PoseMargin,
    /// Share with an error below 0.5.
    Accuracy,
    /// Share of predictions on the same side of 2.5 as the label.
    DiagnosticAccuracy,
    /// Share of the non-diagnostic poses that are predicted as such.
    Sensitivity,
    /// Share of the diagnostic poses that are predicted as such.
    Specificity,
}

impl Metric {
    /// Returns the rows of an experiment's table, in the paper's order.
    pub fn of(experiment: Experiment) -> Vec<Self> {
        let ranking =
            (experiment == Experiment::TwoB).then_some([Self::PoseDelta, Self::PoseMargin]);
        [Self::Mae, Self::Correlation]
            .into_iter()
            .chain(ranking.into_iter().flatten())
            .chain([
                Self::Accuracy,
                Self::DiagnosticAccuracy,
                Self::Sensitivity,
                Self::Specificity,
            ])
            .collect()
    }

    /// Returns the row's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mae => "MAE",
            Self::Correlation => "Correlation r_s",
            Self::PoseDelta => "Pose Delta",
            Self::PoseMargin => "Pose Margin Accuracy [%]",
            Self::Accuracy => "Accuracy [%]",
            Self::DiagnosticAccuracy => "Diag. Acc. [%]",
            Self::Sensitivity => "Sens. [%]",
            Self::Specificity => "Spec. [%]",
        }
    }

    /// Returns the factor by which printed values are multiplied: 100 for percentages.
    pub fn scale(self) -> f64 {
        match self {
            Self::Mae | Self::Correlation | Self::PoseDelta => 1.0,
            _ => 100.0,
        }
    }

    /// Returns whether the lowest value is the best.
    pub fn lower_is_better(self) -> bool {
        self == Self::Mae
    }

    /// Returns the value for one test set; `None` if it is not defined, such as a correlation with constant predictions.
    ///
    /// # Errors
    /// [`PredictionError`] for limbs without one good and two bad poses, if the metric requires them, and for
    /// predictions that are not finite.
    pub fn value(self, rows: &[Prediction]) -> Result<Option<f64>, PredictionError> {
        let labels: Vec<_> = rows.iter().map(|row| row.label).collect();
        let predictions: Vec<_> = rows.iter().map(|row| row.prediction).collect();
        let (labels, predictions) = (&labels[..], &predictions[..]);
        let found = match self {
            Self::Mae => metrics::mae(labels, predictions),
            Self::Correlation => metrics::spearman(labels, predictions),
            Self::PoseDelta => metrics::pose_delta(&pose_triples(rows)?),
            Self::PoseMargin => metrics::pose_margin_accuracy(&pose_triples(rows)?),
            Self::Accuracy => metrics::accuracy(labels, predictions),
            Self::DiagnosticAccuracy => metrics::diagnostic_accuracy(labels, predictions),
            Self::Sensitivity => metrics::sensitivity(labels, predictions),
            Self::Specificity => metrics::specificity(labels, predictions),
        };
        match found {
            Ok(value) => Ok(Some(value)),
            Err(
                metrics::MetricError::Constant { .. }
                | metrics::MetricError::NoPositives
                | metrics::MetricError::NoNegatives,
            ) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }
}
