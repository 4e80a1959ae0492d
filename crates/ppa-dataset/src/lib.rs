//! Cases, plans and paired depth/radiograph datasets of posed limbs.
//!
//! [`prepare`] turns a CT into a [`Case`] that records every preprocessing decision; a [`Plan`]
//! names cases, room, cameras, beam, rotations and body shapes; [`generate`] makes the dataset
//! in the layout published by the paper's authors ([`layout`]), with a [`Manifest`].
//!
//! Units: mm, degrees in files; 16-bit depth in mm, 0 invalid. Frames: as in `ppa-scene`.
//! Repeatable: the same plan and seed give the same bytes for any number of threads and after
//! any interruption.
//!
//! Source of the method: Laufer et al., Patient Pose Assessment Using a CT-Based Framework for
//! Synthetic Data Generation, MELBA 2026:027, doi:10.59275/j.melba.2026-c874.

mod body_shape;
mod case;
mod check;
mod claim;
mod contact_sheet;
mod coverage_plot;
mod description;
mod drawing;
mod files;
mod forecast;
mod frames;
mod generate;
mod job;
pub mod labels;
pub mod layout;
#[cfg(test)]
mod load;
mod manifest;
mod merge;
mod part_file;
mod plan;
mod planned;
mod prepare;
mod radiograph;
mod record;
mod room_file;
mod seed;
mod stage;
mod status;
mod unit;
mod verify;

pub use body_shape::{BodyShape, ShapeSettings, body_shape};
pub use case::{Case, CaseError, Found, Source};
pub use check::{Check, Problem, check};
pub use claim::FolderError;
pub use contact_sheet::{ContactSheetError, contact_sheet};
pub use coverage_plot::{RankedView, coverage_plot};
pub use files::{FileError, sha256_of_file, write_whole};
pub use forecast::{Forecast, ForecastError, forecast};
pub use frames::Frames;
pub use generate::{GenerateError, GenerateSettings, generate};
pub use job::{JobError, Progress, Summary};
pub use manifest::{FileKind, FileRow, Manifest, RoiFile, RoiRow, Rows};
pub use merge::{MergeError, merge};
pub use plan::{DepthSettings, Plan, PlanCase, PlanError, PlanRoom, XraySettings};
pub use prepare::{PrepareError, PreparedLimb, prepare, volume_sha256};
pub use radiograph::{JointError, joint_phantom, projection};
pub use room_file::RoomFile;
pub use stage::{PlacedCamera, Stage, StageError, Table, spectrum, tube};
pub use status::{LimbStatus, Status, status};
pub use unit::UnitError;
pub use verify::{Verification, VerifyError, verify};
