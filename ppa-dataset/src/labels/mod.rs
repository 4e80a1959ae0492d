//! Labels of poses in files.
//!
//! [`LabelFile`] is `labels.json`, in which a reader's label takes precedence over a computed one. Further named sets of labels are stored next to
//! it, in `labels.NAME.json`.

mod bone_file;
mod file;
mod label;
mod name;

pub use bone_file::{BoneFile, BoneNumbers};
pub use file::{LabelFile, LabelFileError};
pub use label::{LabelError, LabelRow, LabelSource};
pub(crate) use label::{Sources, name_of};
pub use name::{LabelName, LabelNameError};
