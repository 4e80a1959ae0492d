//! Errors of the quality report.

use ppa_dataset::files::FileError;
use ppa_dataset::published::PublishedError;
use ppa_dataset::split::SplitError;

use crate::contact_sheet::ContactSheetError;

/// Why the quality report cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum QaError {
    /// A file of the dataset.
    #[error(transparent)]
    File(#[from] FileError),
    /// Its layout or lists.
    #[error(transparent)]
    Published(#[from] PublishedError),
    /// One of its splits.
    #[error(transparent)]
    Split(#[from] SplitError),
    /// Its contact sheets.
    #[error(transparent)]
    ContactSheet(#[from] ContactSheetError),
}
