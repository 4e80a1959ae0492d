//! Why predictions cannot be evaluated.

use ppa_dataset::FileError;

use crate::data::DataError;

/// Why predictions cannot be evaluated, or an evaluation cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluateError {
    /// A prediction that no metric is defined for.
    #[error("{image}: the prediction is {prediction}, expected a finite number")]
    NotFinite {
        /// The image.
        image: String,
        /// What the network said.
        prediction: f64,
    },
    /// An image that a baseline cannot use.
    #[error(transparent)]
    Data(#[from] DataError),
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
    /// A row that is no CSV.
    #[error("rows cannot be written as CSV")]
    Csv(#[from] csv::Error),
}
