//! Generates the dataset of a plan: resumable, and the same bytes for any number of threads.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, MutexGuard, PoisonError};

use ppa_core::Part;
use ppa_dataset::archive::is_archive;
use ppa_dataset::files::FileError;
use ppa_dataset::findings::{Finding, Findings};
use ppa_dataset::layout::LimbId;
use ppa_dataset::stop::{Stopped, go_on};
use ppa_scene::SweepError;

use crate::analog_histories::AnalogHistories;
use crate::archived_run::ArchivedRun;
use crate::case::{Case, CaseError};
use crate::description::{Description, Settings};
use crate::job::{Job, JobError, MakePose, Progress, Summary};
use crate::limb_jobs::{LimbJobs, PlannedLimb, jobs_of_part};
use crate::plan::Plan;
use crate::posable_limb::PosableLimb;
use crate::pose_error::PoseError;
use crate::pose_id::{FOLDER, PoseId};
use crate::prepared_limb::{PrepareError, PreparedLimb};
use crate::record::Record;
use crate::scene_setup::{SceneSetup, SceneSetupError};
use crate::several_limbs::{for_each_limb, limbs_at_once};
use crate::staging::staging_folder;

/// Why a dataset could not be made. Finished poses stay and are not made again.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GenerateError {
    /// The rotations of the plan are invalid.
    #[error(transparent)]
    Rotation(#[from] SweepError),
    /// A case file.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// Room, cameras or beam.
    #[error(transparent)]
    SceneSetup(#[from] SceneSetupError),
    /// A limb of the plan cannot be prepared.
    #[error("cannot prepare the limb of {}", case.display())]
    Limb {
        /// Its case file.
        case: PathBuf,
        /// The cause.
        source: Box<PrepareError>,
    },
    /// A limb of the plan cannot be shaped or converted to voxels for the radiograph.
    #[error("cannot pose the limb of {}", case.display())]
    Posable {
        /// Its case file.
        case: PathBuf,
        /// The cause.
        source: PoseError,
    },
    /// A pose cannot be made.
    #[error("cannot make the pose at {angle_deg} degrees of {}", case.display())]
    Pose {
        /// Its case file.
        case: PathBuf,
        /// Medial rotation.
        angle_deg: f64,
        /// The cause.
        source: PoseError,
    },
    /// The folder, its files or the disk cannot be used.
    #[error(transparent)]
    Job(#[from] JobError),
    /// A file that the plan names cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// [`GenerateSettings::stop`] became true.
    #[error("the run ended before its last pose")]
    Stopped(#[from] Stopped),
    /// A plan made in memory that would be refused if it were read from a file.
    #[error("the plan cannot be used: {0}")]
    Unusable(String),
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
    /// Two patients are one person, whose images could then be in both training and test data.
    #[error(
        "{} and {} come from the same scan, but are patients {} and {}; give them one number",
        first.display(), second.display(), patients[0], patients[1]
    )]
    SameScan {
        /// A case file.
        first: PathBuf,
        /// Another case file.
        second: PathBuf,
        /// Their numbers.
        patients: [u32; 2],
    },
}

/// Which poses of a plan are made, how much disk they may take, and what ends the run early.
#[derive(Debug, Clone, Copy)]
pub struct GenerateSettings<'a> {
    /// One of several equal parts of the plan; each goes into a folder of its own.
    pub part: Part,
    /// Bytes that the images may take; poses in progress may briefly exceed it.
    pub disk_limit: Option<u64>,
    /// Once true, poses in progress are finished and no other begins. Analog radiographs in progress end, and the next run resumes from
    /// their histories.
    pub stop: Option<&'a AtomicBool>,
    /// Whether poses of other settings, scans or sources are replaced, and those that are not in the plan removed.
    pub replace: bool,
}

impl Default for GenerateSettings<'_> {
    /// All poses, without disk limit and stop flag, and nothing is replaced.
    fn default() -> Self {
        Self {
            part: Part::WHOLE,
            disk_limit: None,
            stop: None,
            replace: false,
        }
    }
}

/// Makes the missing poses of the plan's dataset in the folder `root`, or in the tar archive of this path if it ends in `.tar`.
///
/// Every pose is generated on its own: its files appear complete, its record last, so a killed run resumes where it stopped. A pose is made
/// again if its record is missing or damaged, or if one of its files is missing or altered; altered files are moved to `.ppa/altered`.
///
/// Poses with analog radiographs are made one by one. Their histories are saved in `.ppa/histories`, or next to an archive in
/// `NAME.tar.histories`, until the pose is complete.
///
/// A folder with poses made from other inputs (plan settings, case, code and physics data) or with poses that are not in the plan is
/// refused, unless `settings` ask to replace them. Then each of them stays until its successor is complete, and those without a successor
/// until all others are.
///
/// An archive holds the files of the folder. Poses are made in a temporary folder and added to it one by one; at the end it is
/// written in a fixed order.
///
/// # Errors
/// [`GenerateError`], naming the file or pose at fault.
pub fn generate(
    plan: &Plan,
    root: &Path,
    settings: &GenerateSettings,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Summary, GenerateError> {
    let work = Work::of_plan(plan)?;
    let stop = settings.stop;
    if is_archive(root) {
        let mut folder = root.as_os_str().to_owned();
        folder.push(".histories");
        let folder = folder.into();
        return ArchivedRun::complete(root, |run| {
            let histories = AnalogHistories { folder, stop };
            let kept = |pose: PoseId, record: &Record| run.add(pose, record);
            let made = generate_in(&work, run.folder(), settings, progress, &histories, &kept);
            made.map_err(|error| match error {
                GenerateError::Job(error) => GenerateError::Job(error.of_archive(run)),
                error => error,
            })
        });
    }
    let folder = root.join(FOLDER).join("histories");
    let histories = AnalogHistories { folder, stop };
    generate_in(&work, root, settings, progress, &histories, &|_, _| Ok(()))
}

/// Makes the missing poses in a folder, and calls `kept` after each of them.
fn generate_in(
    work: &Work,
    root: &Path,
    settings: &GenerateSettings,
    progress: &(dyn Fn(Progress) + Sync),
    histories: &AnalogHistories,
    kept: &(dyn Fn(PoseId, &Record) -> Result<(), FileError> + Sync),
) -> Result<Summary, GenerateError> {
    let poses = work.plan.rotation.poses()?;
    let limbs = jobs_of_part(work.planned(), &poses, settings.part);
    let findings = work.findings(&limbs, root, limbs_at_once())?;
    progress(Progress::Findings(&findings));
    let staging = staging_folder(root);
    let job = Job {
        root,
        description: &work.description,
        part: settings.part,
        limbs,
        disk_limit: settings.disk_limit,
        replace: settings.replace,
        progress,
        one_by_one: work.plan.xray.analog.is_some(),
        kept: &|pose, record| {
            kept(pose, record)?;
            histories.remove(pose)
        },
    };
    let summary = job.complete(|limb| {
        settings.stop.map_or(Ok(()), go_on)?;
        let make = work.prepare(limb.limb, &staging, Some(histories))?;
        let make: MakePose<GenerateError> = Box::new(move |pose_job| {
            settings.stop.map_or(Ok(()), go_on)?;
            make(pose_job)
        });
        Ok(make)
    })?;
    histories.remove_all();
    Ok(summary)
}

/// A plan with its cases and its scene setup: all that poses are generated from.
pub(crate) struct Work<'a> {
    plan: &'a Plan,
    limbs: Vec<CasedLimb>,
    setup: SceneSetup,
    /// `dataset.json`.
    pub description: String,
    /// Limbs that were prepared for their findings, kept until their poses are made.
    prepared: Mutex<Vec<(LimbId, PreparedLimb)>>,
}

struct CasedLimb {
    id: LimbId,
    key: String,
    case: Case,
    file: PathBuf,
}

impl<'a> Work<'a> {
    pub fn of_plan(plan: &'a Plan) -> Result<Self, GenerateError> {
        plan.check().map_err(GenerateError::Unusable)?;
        let settings = Settings::of(plan)?;
        let limbs = planned_limbs(plan, &settings)?;
        let setup = SceneSetup::of_plan(plan)?;
        let cases = limbs.iter().map(|limb| (limb.id, &limb.case));
        let description = Description::of(plan.rotation, &settings, &setup, cases).to_text();
        Ok(Self {
            plan,
            limbs,
            setup,
            description,
            prepared: Mutex::default(),
        })
    }

    /// The limbs, as `dataset.json` lists them.
    pub fn planned(&self) -> impl ExactSizeIterator<Item = PlannedLimb> {
        self.limbs.iter().map(|limb| PlannedLimb {
            limb: limb.id,
            key: limb.key.clone(),
            acknowledged: limb.case.acknowledged.clone(),
        })
    }

    /// Returns the findings about limbs before any of their poses is made. Limbs with a pose in the folder `root` are not prepared for it.
    /// The first `keep` limbs stay prepared for their poses; the others are prepared twice, since memory may not hold them all.
    pub fn findings(
        &self,
        limbs: &[LimbJobs],
        root: &Path,
        keep: usize,
    ) -> Result<Findings, GenerateError> {
        let of_limbs = for_each_limb(limbs, |index, limb| {
            let made = limb.pose_jobs().find_map(|pose_job| {
                let record = Record::read(root, &pose_job).ok()?;
                (record.key == pose_job.key()).then_some(record.findings)
            });
            match made {
                Some(findings) => Ok(findings),
                None => self.findings_of(limb.limb, index < keep),
            }
        })?;
        let mut findings = Findings::default();
        for (limb, of_limb) in limbs.iter().zip(&of_limbs) {
            findings.add(limb.limb, &limb.acknowledged, of_limb);
        }
        Ok(findings)
    }

    /// Returns the findings of a limb, which stays prepared for its poses if `keep` is true.
    fn findings_of(&self, id: LimbId, keep: bool) -> Result<Vec<Finding>, GenerateError> {
        let prepared = self.limb(id).prepared()?;
        let findings = prepared.findings.clone();
        if keep {
            self.kept().push((id, prepared));
        }
        Ok(findings)
    }

    fn kept(&self) -> MutexGuard<'_, Vec<(LimbId, PreparedLimb)>> {
        self.prepared.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn limb(&self, id: LimbId) -> &CasedLimb {
        let limb = self.limbs.iter().find(|limb| limb.id == id);
        limb.expect("only limbs of the plan are asked for")
    }

    /// Prepares and shapes a limb; the returned function makes its poses below `root`.
    pub fn prepare<'m>(
        &'m self,
        id: LimbId,
        root: &'m Path,
        histories: Option<&'m AnalogHistories>,
    ) -> Result<MakePose<'m, GenerateError>, GenerateError> {
        let limb = self.limb(id);
        let case = || limb.file.clone();
        let kept = self.kept().extract_if(.., |(kept, _)| *kept == id).next();
        let prepared = match kept {
            Some((_, prepared)) => prepared,
            None => limb.prepared()?,
        };
        let posable = PosableLimb::new(id, self.plan, &self.setup, prepared).map_err(|source| {
            GenerateError::Posable {
                case: case(),
                source,
            }
        })?;
        Ok(Box::new(move |pose_job| {
            posable
                .make(&pose_job, root, histories)
                .map_err(|source| match source {
                    PoseError::Stopped(stopped) => stopped.into(),
                    source => GenerateError::Pose {
                        case: limb.file.clone(),
                        angle_deg: pose_job.pose.angle_deg,
                        source,
                    },
                })
        }))
    }
}

impl CasedLimb {
    fn prepared(&self) -> Result<PreparedLimb, GenerateError> {
        PreparedLimb::of_case(&self.case).map_err(|error| GenerateError::Limb {
            case: self.file.clone(),
            source: Box::new(error),
        })
    }
}

fn planned_limbs(plan: &Plan, settings: &Settings) -> Result<Vec<CasedLimb>, GenerateError> {
    let mut limbs: Vec<CasedLimb> = Vec::new();
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
        let scan = &case.source.volume_sha256;
        let of_another = |other: &&CasedLimb| {
            other.case.source.volume_sha256 == *scan && other.id.patient != id.patient
        };
        if let Some(other) = limbs.iter().find(of_another) {
            return Err(GenerateError::SameScan {
                first: other.file.clone(),
                second: planned.file.clone(),
                patients: [other.id.patient, id.patient],
            });
        }
        limbs.push(CasedLimb {
            id,
            key: settings.limb_key(id, &case),
            case,
            file: planned.file.clone(),
        });
    }
    Ok(limbs)
}
