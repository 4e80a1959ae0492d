//! Why a dataset has no quality report.

use ppa_dataset::files::FileError;
use ppa_dataset::published::PublishedError;
use ppa_dataset::split::SplitError;

use crate::contact_sheet::ContactSheetError;

/// Why there is no page.
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
