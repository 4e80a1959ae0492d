//! Why a folder is not a dataset in a published layout.

use std::path::PathBuf;

use crate::files::FileError;
use crate::labels::LabelFileError;

/// Why a folder is not a dataset in a published layout.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PublishedError {
    /// A file or folder cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// Labels of a limb in the synthetic layout.
    #[error(transparent)]
    Labels(#[from] LabelFileError),
    /// The dataset contains no person.
    #[error("{} holds no images of patients: expected folders patient_0, patient_1, … or patient_1_l, patient_1_r, …", .0.display())]
    NoSubjects(PathBuf),
    /// Folders of both layouts.
    #[error("{} belongs to the specimen layout, {} to the synthetic one; a dataset must have a single layout", specimen.display(), synthetic.display())]
    TwoLayouts {
        /// A folder `patient_N_l` or `patient_N_r`.
        specimen: PathBuf,
        /// A folder `patient_N`.
        synthetic: PathBuf,
    },
    /// A file or folder whose name does not fit the layout.
    #[error("{} does not fit the layout: expected {expected}", path.display())]
    Name {
        /// The file or folder.
        path: PathBuf,
        /// Names that the layout allows there.
        expected: &'static str,
    },
    /// Two folders of one person or limb, such as `patient_1` and `patient_01`.
    #[error("{} is another name for {}", second.display(), first.display())]
    SameSubject {
        /// The folder with the correct name.
        first: PathBuf,
        /// The other one.
        second: PathBuf,
    },
    /// An angle that is not a step.
    #[error("{}: the angle is {angle} degrees, expected a multiple of 0.5 with one decimal", path.display())]
    OffGrid {
        /// The depth image.
        path: PathBuf,
        /// The angle in its name.
        angle: String,
    },
    /// Labels of radiographs that have since been replaced.
    #[error(
        "{}: {} of radiographs that have since been replaced, the first at step {step}; create them again \
         (`ppa label auto` or `ppa label import`) or remove the file",
        path.display(), ppa_core::text::count(*count, "label")
    )]
    Outdated {
        /// `labels.json` of the limb.
        path: PathBuf,
        /// Half degrees of rotation of the first of these radiographs.
        step: u32,
        /// Their number.
        count: usize,
    },
    /// An invalid entry of a JSON file.
    #[error("{}, entry {key:?}: {message}", path.display())]
    Entry {
        /// The file.
        path: PathBuf,
        /// The entry's key.
        key: String,
        /// What was found and what was expected.
        message: String,
    },
}
