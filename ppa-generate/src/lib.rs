//! Generation of paired depth and radiograph datasets of posed limbs.
//!
//! [`prepare`] turns a CT into a [`Case`] that records every preprocessing decision; a [`Plan`] names cases, room, cameras, beam,
//! rotations and body shapes; [`generate`] makes the dataset in the layout of `ppa-dataset`, pose by pose; [`merge`] joins the
//! parts that several machines made; [`check`] and [`verify`] look for damage; [`forecast`] estimates time and disk.
//! [`ExposableLimb`] and [`VisibleLimb`] make the images of a single pose.
//!
//! Units: mm, degrees in files; 16-bit depth in mm, 0 invalid. Frames: as in `ppa-scene`.
//! Repeatable: the same plan and seed give the same bytes for any number of threads and after any interruption.
//!
//! Source of the method: Laufer et al., Patient Pose Assessment Using a CT-Based Framework for
//! Synthetic Data Generation, MELBA 2026:027, doi:10.59275/j.melba.2026-c874.

mod analog_histories;
mod archived_dataset;
mod archived_run;
mod case;
mod case_check;
mod case_names;
mod check;
mod closed_skin;
mod commented_plan;
mod compiled;
mod coverage_study;
mod cut_error;
mod cut_findings;
mod cut_share;
mod dataset_files;
mod dataset_lock;
mod depth_views;
mod description;
mod differences;
mod exposable_limb;
mod forecast;
mod frames;
mod gates;
mod generate;
mod held_part;
mod job;
#[cfg(test)]
mod job_trials;
mod keep_damaged;
mod limb_jobs;
mod lists;
#[cfg(test)]
mod load;
mod loaded_scan;
mod made_images;
mod merge;
mod off_detector;
mod overview;
mod part_file;
mod plan;
mod plan_comments;
mod planned;
mod posable_limb;
mod pose_error;
mod pose_id;
mod prepare;
mod prepared_limb;
mod radiograph;
mod record;
mod scene_setup;
mod seal;
mod seed;
mod set_aside;
mod several_limbs;
mod shaped_skin;
mod staging;
mod status;
mod survey;
mod technique;
mod toml_edits;
mod toml_file;
mod verify;
mod write_archive;

pub use case::{Case, CaseError, Found, Source};
pub use case_check::{CaseCheck, CaseCheckError, Drift};
pub use case_names::{beside_case, edited_case, original_case, plan_of_dataset};
pub use check::{Check, Problem, check};
pub use closed_skin::closed_skin;
pub use coverage_study::{
    CameraPlace, CoverageStudy, CoverageStudyError, JointInRoom, RankedPlace,
};
pub use cut_error::{CutError, ExceededLimit, PoseImage};
pub use dataset_lock::FolderError;
pub use depth_views::{DepthView, PosedSkin, VisibleLimb};
pub use differences::KeyDifference;
pub use exposable_limb::{ExposableLimb, ExposureError, PosedExposure};
pub use forecast::{Forecast, ForecastError, forecast, free_bytes};
pub use frames::Frames;
pub use gates::NotALimb;
pub use generate::{GenerateError, GenerateSettings, generate};
pub use held_part::held_part;
pub use job::{JobError, Progress, Summary};
pub use loaded_scan::LoadedScan;
pub use made_images::{MadeImages, made_images};
pub use merge::{MergeError, merge};

pub use plan::{
    DepthSettings, MarkerPlace, Plan, PlanCase, PlanError, PlanRoom, RoomFile, XraySettings,
};
pub use pose_error::PoseError;
pub use prepare::{prepare, prepare_scan};
pub use prepared_limb::{PrepareError, PreparedLimb};
pub use radiograph::{JointError, prepared_phantom, projection};
pub use scene_setup::{
    PlacedCamera, SceneSetup, SceneSetupError, Table, body_of_cloud, body_of_contents, spectrum,
    tube,
};
pub use shaped_skin::{ShapeSettings, body_shape};
pub use status::{LimbStatus, Status, status};
pub use survey::DatasetDiffers;
pub use technique::Technique;
pub use verify::{Verification, VerifyError, verify};
