//! Errors of evaluations.

use ppa_dataset::FileError;

use crate::data::DataError;

/// Error in evaluating predictions or writing an evaluation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluateError {
    /// A prediction for which no metric is defined.
    #[error("{image}: the prediction is {prediction}, expected a finite number")]
    NotFinite {
        /// The image.
        image: String,
        /// The prediction.
        prediction: f64,
    },
    /// An image that a baseline cannot use.
    #[error(transparent)]
    Data(#[from] DataError),
    /// A file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A row cannot be written as CSV.
    #[error("rows cannot be written as CSV")]
    Csv(#[from] csv::Error),
}
