//! From a plan to a dataset: resumable, and the same bytes for any number of threads.

use std::path::{Path, PathBuf};

use ppa_scene::{PoseAngle, SweepError};
use rayon::prelude::*;
use serde::Serialize;

use crate::case::{Case, CaseError};
use crate::description::{Description, Settings};
use crate::files::{FileError, write_whole};
use crate::layout::LimbId;
use crate::manifest::{FileKind, Manifest, RoiFile};
use crate::plan::Plan;
use crate::prepare::{PrepareError, PreparedLimb};
use crate::record::{Record, claim};
use crate::stage::{Stage, StageError};
use crate::unit::{PosableLimb, UnitError};

/// Why a dataset could not be made. What was finished before stays and is not made again.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GenerateError {
    /// The rotations of the plan.
    #[error(transparent)]
    Rotation(#[from] SweepError),
    /// A case file.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// Room, cameras or beam.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// A limb of the plan.
    #[error("cannot prepare the limb of {}", case.display())]
    Limb {
        /// Its case file.
        case: PathBuf,
        /// What went wrong.
        source: Box<PrepareError>,
    },
    /// A limb of the plan cannot be shaped or turned into voxels for the radiograph.
    #[error("cannot pose the limb of {}", case.display())]
    Posable {
        /// Its case file.
        case: PathBuf,
        /// What went wrong.
        source: UnitError,
    },
    /// One pose.
    #[error("cannot make the pose at {angle_deg} degrees of {}", case.display())]
    Unit {
        /// Its case file.
        case: PathBuf,
        /// Medial rotation.
        angle_deg: f64,
        /// What went wrong.
        source: UnitError,
    },
    /// A file of the dataset.
    #[error(transparent)]
    File(#[from] FileError),
    /// Two cases would write the same files.
    #[error(
        "{} and {} are both the {side} limb of patient {patient}; give one of them another number",
        first.display(), second.display()
    )]
    SameLimb {
        /// A case file.
        first: PathBuf,
        /// Another case file.
        second: PathBuf,
        /// The number they share.
        patient: u32,
        /// The side they share.
        side: &'static str,
    },
    /// The folder holds poses that the plan does not.
    #[error(
        "{} holds a dataset of another plan (its {record} is not in this one); choose another folder",
        root.display()
    )]
    OtherPlan {
        /// The dataset's folder.
        root: PathBuf,
        /// The record of a pose that is not in the plan.
        record: String,
    },
    /// The folder holds something else.
    #[error("{} is neither empty nor a dataset that ppa generate began", .0.display())]
    NotADataset(PathBuf),
    /// Another process writes here.
    #[error("{} is being written by another ppa generate", .0.display())]
    Busy(PathBuf),
}

/// What [`generate`] did.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// Poses in the plan.
    pub units: usize,
    /// Poses that were made in this run; the others were there already.
    pub made: usize,
    /// Depth images in the dataset.
    pub depth_images: usize,
    /// Radiographs in the dataset.
    pub radiographs: usize,
}

/// What a run reports while it goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// The number of poses in the plan, first of all.
    Total(usize),
    /// Another pose is complete, or was found complete.
    Done,
}

/// Makes what is missing of the plan's dataset in the folder `root`.
///
/// Every pose is a unit of its own: its files appear whole, its record last, so a run that was
/// killed goes on where it stopped. A pose is made again when its record is missing, when what
/// it follows from (plan settings, case, code version) has changed, or when one of its files is
/// missing or altered.
///
/// # Errors
/// [`GenerateError`], naming the file or pose at fault.
pub fn generate(
    plan: &Plan,
    root: &Path,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Summary, GenerateError> {
    let limbs = planned_limbs(plan)?;
    let poses = plan.rotation.poses()?;
    let units = || {
        limbs
            .iter()
            .flat_map(|limb| poses.iter().map(|pose| (limb.id, *pose)))
    };
    let stage = Stage::of_plan(plan)?;
    let settings = Settings::of(plan)?;
    let _claim = claim(root, units())?;
    progress(Progress::Total(units().count()));

    let mut made = 0;
    let mut files = Vec::new();
    for limb in &limbs {
        let key = settings.unit_key(limb.id, &limb.case);
        let missing: Vec<_> = poses
            .par_iter()
            .filter(|pose| Record::of_complete(root, limb.id, **pose, &key).is_none())
            .copied()
            .collect();
        (missing.len()..poses.len()).for_each(|_| progress(Progress::Done));
        if !missing.is_empty() {
            limb.make(&missing, plan, &stage, &key, root, progress)?;
            made += missing.len();
        }
        let mut rois = RoiFile::new();
        for pose in &poses {
            let record = Record::read(root, limb.id, *pose)?;
            files.extend(record.files);
            rois.extend(record.rois);
        }
        let rois = serde_json::to_string_pretty(&rois).expect("regions hold only JSON values");
        write_whole(&root.join(limb.id.roi_file()), rois.as_bytes())?;
    }
    let cases = limbs.iter().map(|limb| (limb.id, &limb.case));
    Description::of(settings, &stage, cases).write(root)?;
    let manifest = Manifest {
        root: root.to_owned(),
        files,
    };
    manifest.write()?;
    let count = |kind| manifest.files.iter().filter(|row| row.kind == kind).count();
    Ok(Summary {
        units: units().count(),
        made,
        depth_images: count(FileKind::Depth),
        radiographs: count(FileKind::Radiograph),
    })
}

struct PlannedLimb {
    id: LimbId,
    case: Case,
    file: PathBuf,
}

impl PlannedLimb {
    /// Makes the given poses, several at a time.
    fn make(
        &self,
        poses: &[PoseAngle],
        plan: &Plan,
        stage: &Stage,
        key: &str,
        root: &Path,
        progress: &(dyn Fn(Progress) + Sync),
    ) -> Result<(), GenerateError> {
        let prepared = PreparedLimb::of_case(&self.case).map_err(|error| GenerateError::Limb {
            case: self.file.clone(),
            source: Box::new(error),
        })?;
        let limb = PosableLimb::new(self.id, plan, stage, &prepared).map_err(|source| {
            GenerateError::Posable {
                case: self.file.clone(),
                source,
            }
        })?;
        poses.par_iter().try_for_each(|&pose| {
            let (files, rois) = limb
                .make(pose, root)
                .map_err(|source| GenerateError::Unit {
                    case: self.file.clone(),
                    angle_deg: pose.angle_deg,
                    source,
                })?;
            let key = key.to_owned();
            Record { key, files, rois }.write(root, self.id, pose)?;
            progress(Progress::Done);
            Ok(())
        })
    }
}

fn planned_limbs(plan: &Plan) -> Result<Vec<PlannedLimb>, GenerateError> {
    let mut limbs: Vec<PlannedLimb> = Vec::new();
    for planned in &plan.cases {
        let case = Case::read(&planned.file)?;
        let id = LimbId {
            patient: planned.patient,
            side: case.side,
        };
        if let Some(other) = limbs.iter().find(|other| other.id == id) {
            return Err(GenerateError::SameLimb {
                first: other.file.clone(),
                second: planned.file.clone(),
                patient: id.patient,
                side: id.side_letter(),
            });
        }
        limbs.push(PlannedLimb {
            id,
            case,
            file: planned.file.clone(),
        });
    }
    Ok(limbs)
}
