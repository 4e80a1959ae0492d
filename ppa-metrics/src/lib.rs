//! Metrics of pose assessment, as Laufer et al., MELBA 2026:027 (doi:10.59275/j.melba.2026-c874), define them.
//!
//! A *label* x is the quality that radiologists gave a pose, from 1 (ideal) to 3 (inadequate), in steps of 0.5; a *prediction* y is the
//! continuous output of a network. A pose is non-diagnostic, here called "positive", from [`NON_DIAGNOSTIC`] = 2.5 on. [`evaluate`]
//! returns all metrics as a [`Report`]; each metric is also available by itself. Predictions of two cameras or several frames are averaged
//! first ([`mean_per_pose`], [`mean_of_views`]). [`constant_prediction`] detects predictions that hardly differ, whose metrics mislead.
//!
//! [`pose_delta`] and [`pose_margin_accuracy`] rank one good against two bad poses ([`PoseTriple`]).
//! [`sign_flip_permutation`] is the exact paired test on seeds, whose folds [`mean_per_seed`] averages first.
//!
//! [`agreement`] measures the agreement of the readers whose grades became the labels.
//!
//! Every function returns a [`MetricError`] for empty, unequal, infinite or NaN input; none returns NaN.
//!
//! ```
//! let labels = [1.0, 1.5, 2.5, 3.0];
//! let predictions = [1.2, 1.4, 2.1, 2.9];
//! let report = ppa_metrics::evaluate(&labels, &predictions)?;
//! assert_eq!((report.accuracy, report.diagnostic_accuracy), (1.0, 0.75));
//! assert_eq!((report.sensitivity, report.specificity), (Some(0.5), Some(1.0)));
//! # Ok::<(), ppa_metrics::MetricError>(())
//! ```

mod error;

mod diagnostic;
mod regression;
mod spearman;

mod constant;
mod poses;
mod report;

mod permutation;
mod seeds;

pub mod agreement;

pub use constant::{ConstantPrediction, LEAST_SPREAD, constant_prediction};
pub use diagnostic::{NON_DIAGNOSTIC, diagnostic_accuracy, sensitivity, specificity};
pub use error::MetricError;
pub use permutation::{MAX_PAIRS, PermutationTest, sign_flip_permutation};
pub use poses::{PoseTriple, mean_of_views, mean_per_pose, pose_delta, pose_margin_accuracy};
pub use regression::{ANNOTATION_STEP, accuracy, mae, mse};
pub use report::{Report, evaluate};
pub use seeds::mean_per_seed;
pub use spearman::spearman;
