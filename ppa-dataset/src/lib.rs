//! Datasets of paired depth images and radiographs: layout, manifest, labels, splits, export.
//!
//! [`layout`] names the files as the paper's authors published them; a [`Manifest`] lists the images of a dataset with hash,
//! seed, transforms and settings. [`published`] reads our datasets and those of the authors as rows for training, and
//! converts them; [`labels`] reads and writes labels; a [`Split`] divides persons into parts; [`export`] writes tables,
//! metadata and archives for other programs.
//!
//! `ppa-generate` makes datasets; this crate reads them without depending on the crates needed to make them.
//!
//! Units: mm, degrees in files; 16-bit depth in mm, 0 invalid.
//!
//! Source of the layout: Laufer et al., Patient Pose Assessment Using a CT-Based Framework for
//! Synthetic Data Generation, MELBA 2026:027, doi:10.59275/j.melba.2026-c874.

pub mod archive;
mod body_shape;
pub mod checksums;
mod compiled_with;
pub mod export;
pub mod files;
pub mod findings;
pub mod labels;
pub mod layout;
pub mod manifest;
pub mod published;
pub mod split;
mod spreadsheet;
pub mod stop;
pub mod whole_folder;

pub use body_shape::BodyShape;
pub use compiled_with::compiled_with;
pub use files::{FileError, sha256_of_file, write_whole};
pub use findings::{Finding, FindingCode, Findings, LimbFinding, Severity};
pub use manifest::{FileKind, FileRow, Manifest, RoiFile, RoiRow};
pub use split::{Split, SplitError};
pub use spreadsheet::is_formula;
pub use stop::Stopped;
