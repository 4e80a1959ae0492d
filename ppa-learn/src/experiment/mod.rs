//! The paper's experiments: configurations, training runs, and tables of results.
//!
//! A [`Configuration`] is a column of a table. Each is trained for every fold, camera view and seed ([`runs`]), some
//! after a pretraining that several runs share ([`Training::needs`]). The predictions of the two views are averaged
//! ([`join_views`]), their metrics collected ([`Results`]) and printed as in the paper ([`Table`]). A [`Runner`] does all this for
//! an [`ExperimentPlan`].

mod baselines;
mod cell;
mod check_data;
mod configuration;
mod error;
mod folds;
mod metric;
mod plan;
mod predictions;
mod published;
mod record;
mod results;
mod run;
mod table;
mod training;

pub use configuration::{
    Configuration, Experiment, Shapes, Start, UnknownExperiment, Variation, ViewChoice,
};
pub use error::ExperimentError;
pub use folds::{FoldError, cross_validation, folds_of_limbs};
pub use metric::Metric;
pub use plan::{ExperimentPlan, Fold, LearningCurves, Synthetic, Target};
pub use predictions::{Moment, Prediction, PredictionError, join_views, pose_triples};
pub use published::published;
pub use results::{Comparison, Difference, Missing, Results, Summary};
pub use run::{Begun, Event, Runner};
pub use table::{Incomplete, Table, TableCell};
pub use training::{Training, runs};
