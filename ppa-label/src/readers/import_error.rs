//! Why readers' grades cannot become labels.

use std::path::PathBuf;

use ppa_dataset::files::FileError;
use ppa_dataset::labels::{LabelError, LabelFileError};

use crate::table::TableError;

/// Why readers' grades cannot become labels; nothing was written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A file is not a table of grades.
    #[error(transparent)]
    Table(#[from] TableError),
    /// No file contains a grade.
    #[error("there are no grades to import")]
    Empty,
    /// A grade off the scale.
    #[error("{}: {reader} grades {image} as {grade}, expected 1, 1.5, 2, 2.5 or 3", path.display())]
    Grade {
        /// The file.
        path: PathBuf,
        /// The reader.
        reader: String,
        /// The picture.
        image: String,
        /// The grade.
        grade: f64,
    },
    /// A reader's name that spreadsheet programs would run as a formula.
    #[error("{}: the reader's name is {reader:?}, which spreadsheets interpret as a formula; expected a name that does not begin with = + - @, a tab or a carriage return", path.display())]
    Formula {
        /// The file.
        path: PathBuf,
        /// The name.
        reader: String,
    },
    /// A picture that is neither in the key nor in the dataset.
    #[error("{}: {image} is neither a picture in the key nor a radiograph in the dataset", path.display())]
    Unknown {
        /// The file.
        path: PathBuf,
        /// The picture.
        image: String,
    },
    /// The dataset has changed since the key was made.
    #[error(
        "{0} is not the radiograph that the readers saw: its hash does not match the one in the key"
    )]
    Changed(String),
    /// The dataset has changed since a grade was imported.
    #[error(
        "{}: {reader} graded a different version of {image}: its hash was {found}, but the manifest has {expected}; move the file \
         away to start again",
        path.display()
    )]
    OtherRadiograph {
        /// The file.
        path: PathBuf,
        /// The reader.
        reader: String,
        /// The radiograph.
        image: String,
        /// Hash in the file.
        found: String,
        /// Hash in the manifest.
        expected: String,
    },
    /// A picture graded twice, a radiograph graded a third time or in two files.
    #[error("{reader} grades {image} in {} and again in {}", first.display(), second.display())]
    Twice {
        /// The reader.
        reader: String,
        /// The picture or radiograph.
        image: String,
        /// A file.
        first: PathBuf,
        /// Another file, or the same one.
        second: PathBuf,
    },
    /// Existing grades would be lost.
    #[error(
        "{} holds {reader}'s grade {grade} of {image}, but none of the given files does: give the missing file as well or, \
         if the reader has changed the grade, move this one away and give the files of all readers",
        path.display()
    )]
    Lost {
        /// `grades.csv` of the dataset.
        path: PathBuf,
        /// The reader.
        reader: String,
        /// The radiograph.
        image: String,
        /// The grade.
        grade: f64,
    },
    /// Existing labels of readers would be lost.
    #[error(
        "{} holds readers' labels that do not follow from grades.csv; move it away or give their grades before other labels replace them",
        .0.display()
    )]
    OtherLabels(PathBuf),
    /// The existing labels are invalid.
    #[error(transparent)]
    Labels(#[from] LabelFileError),
    /// A label off the grid.
    #[error(transparent)]
    Label(#[from] LabelError),
}
