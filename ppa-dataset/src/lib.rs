//! Cases, plans and paired depth/radiograph datasets of posed limbs.
//!
//! [`prepare`] turns a CT into a [`Case`] that records every preprocessing decision; a [`Plan`]
//! names cases, room, cameras, beam, rotations and body shapes; [`generate`] makes the dataset
//! in the layout published by the paper's authors ([`layout`]), with a [`Manifest`].
//!
//! [`published`] reads datasets, ours and those of the authors, as rows for training.
//!
//! Feature `generate` (on by default): cases, plans and all that makes images. Without it the crate reads and writes
//! datasets and depends on no other crate of the workspace.
//!
//! Units: mm, degrees in files; 16-bit depth in mm, 0 invalid. Frames: as in `ppa-scene`.
//! Repeatable: the same plan and seed give the same bytes for any number of threads and after
//! any interruption.
//!
//! Source of the method: Laufer et al., Patient Pose Assessment Using a CT-Based Framework for
//! Synthetic Data Generation, MELBA 2026:027, doi:10.59275/j.melba.2026-c874.

mod body_shape;
#[cfg(feature = "generate")]
mod case;
#[cfg(feature = "generate")]
mod case_check;
#[cfg(feature = "generate")]
mod check;
mod checksums;
#[cfg(feature = "generate")]
mod claim;
#[cfg(feature = "generate")]
mod closed_skin;
#[cfg(feature = "generate")]
mod commented_plan;
#[cfg(feature = "generate")]
mod compiled;
#[cfg(feature = "generate")]
mod contact_sheet;
#[cfg(feature = "generate")]
mod coverage_plot;
#[cfg(feature = "generate")]
mod cut_findings;
#[cfg(feature = "generate")]
mod cut_share;
#[cfg(feature = "generate")]
mod depth_views;
#[cfg(feature = "generate")]
mod description;
#[cfg(feature = "generate")]
mod differences;
#[cfg(feature = "generate")]
mod drawing;
pub mod export;
mod files;
mod findings;
#[cfg(feature = "generate")]
mod forecast;
#[cfg(feature = "generate")]
mod frames;
#[cfg(feature = "generate")]
mod gates;
#[cfg(feature = "generate")]
mod generate;
#[cfg(feature = "generate")]
mod job;
#[cfg(all(test, feature = "generate"))]
mod job_trials;
pub mod labels;
pub mod layout;
#[cfg(feature = "generate")]
mod lists;
#[cfg(all(test, feature = "generate"))]
mod load;
mod manifest;
#[cfg(feature = "generate")]
mod merge;
#[cfg(all(test, feature = "generate"))]
mod only_read;
#[cfg(feature = "generate")]
mod overview;
#[cfg(feature = "generate")]
mod part_file;
#[cfg(feature = "generate")]
mod pictures;
#[cfg(feature = "generate")]
mod plan;
#[cfg(feature = "generate")]
mod planned;
#[cfg(feature = "generate")]
mod prepare;
pub mod published;
#[cfg(feature = "generate")]
mod qa;
#[cfg(feature = "generate")]
mod radiograph;
#[cfg(feature = "generate")]
mod record;
#[cfg(feature = "generate")]
mod room_file;
#[cfg(feature = "generate")]
mod seal;
#[cfg(feature = "generate")]
mod seed;
#[cfg(feature = "generate")]
mod set_aside;
#[cfg(feature = "generate")]
mod shaped_skin;
mod split;
mod spreadsheet;
#[cfg(feature = "generate")]
mod stage;
#[cfg(feature = "generate")]
mod staging;
#[cfg(feature = "generate")]
mod status;
mod stop;
#[cfg(feature = "generate")]
mod survey;
#[cfg(feature = "generate")]
mod toml_file;
#[cfg(feature = "generate")]
mod unit;
#[cfg(feature = "generate")]
mod verify;
mod whole_folder;

pub use body_shape::BodyShape;
#[cfg(feature = "generate")]
pub use case::{Case, CaseError, Found, Source};
#[cfg(feature = "generate")]
pub use case_check::{CaseCheck, CaseCheckError, Drift};
#[cfg(feature = "generate")]
pub use check::{Check, Problem, check};
#[cfg(feature = "generate")]
pub use claim::FolderError;
#[cfg(feature = "generate")]
pub use closed_skin::closed_skin;
#[cfg(feature = "generate")]
pub use contact_sheet::{ContactSheetError, contact_sheet};
#[cfg(feature = "generate")]
pub use coverage_plot::{RankedView, coverage_plot};
#[cfg(feature = "generate")]
pub use cut_share::{CutError, PoseImage};
#[cfg(feature = "generate")]
pub use depth_views::{DepthView, depth_views};
#[cfg(feature = "generate")]
pub use differences::KeyDifference;
pub use files::{FileError, sha256_of_file, write_whole};
pub use findings::{Finding, FindingCode, Findings, LimbFinding, Severity};
#[cfg(feature = "generate")]
pub use forecast::{Forecast, ForecastError, forecast, free_bytes};
#[cfg(feature = "generate")]
pub use frames::Frames;
#[cfg(feature = "generate")]
pub use gates::NotALimb;
#[cfg(feature = "generate")]
pub use generate::{GenerateError, GenerateSettings, generate};
#[cfg(feature = "generate")]
pub use job::{JobError, Progress, Summary};
pub use manifest::{FileKind, FileRow, Manifest, RoiFile, RoiRow};
#[cfg(feature = "generate")]
pub use merge::{MergeError, merge};
#[cfg(feature = "generate")]
pub use part_file::held_part;
#[cfg(feature = "generate")]
pub use pictures::{PosedLimb, case_picture, pose_picture, write_picture};
#[cfg(feature = "generate")]
pub use plan::{DepthSettings, Plan, PlanCase, PlanError, PlanRoom, XraySettings};
#[cfg(feature = "generate")]
pub use prepare::{PrepareError, PreparedLimb, prepare, volume_sha256};
#[cfg(feature = "generate")]
pub use qa::{QaError, qa_page};
#[cfg(feature = "generate")]
pub use radiograph::{JointError, joint_phantom, projection};
#[cfg(feature = "generate")]
pub use room_file::RoomFile;
#[cfg(feature = "generate")]
pub use shaped_skin::{ShapeSettings, body_shape};
pub use split::{Split, SplitError};
pub use spreadsheet::is_formula;
#[cfg(feature = "generate")]
pub use stage::{PlacedCamera, Stage, StageError, Table, body_of_cloud, spectrum, tube};
#[cfg(feature = "generate")]
pub use status::{LimbStatus, Status, status};
pub use stop::Stopped;
#[cfg(feature = "generate")]
pub use survey::DatasetDiffers;
#[cfg(feature = "generate")]
pub use unit::UnitError;
#[cfg(feature = "generate")]
pub use verify::{Verification, VerifyError, verify};
