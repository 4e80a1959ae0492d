//! Runs the pose jobs of a dataset: keeps finished poses, makes the missing ones.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use ppa_core::Part;
use ppa_dataset::files::FileError;
use ppa_dataset::findings::Findings;
use ppa_dataset::manifest::DESCRIPTION_FILE;
use ppa_dataset::manifest::FileKind;
use ppa_scene::PoseAngle;
use rayon::prelude::*;
use serde::Serialize;

use crate::dataset_lock::{DatasetLock, FolderError, lock};
use crate::held_part::require_part;
use crate::limb_jobs::LimbJobs;
use crate::lists::Lists;
use crate::overview::Overview;
use crate::posable_limb::Images;
use crate::pose_id::PoseId;
use crate::record::{FoundRecord, PoseJob, Record};
use crate::several_limbs::for_each_limb;
use crate::staging::{Staging, staging_folder};
use crate::survey::Survey;

/// What a run did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Poses of the plan, or of the shard.
    #[serde(rename = "units")]
    pub pose_jobs: usize,
    /// Poses that were made in this run; the others existed already.
    pub made: usize,
    /// Depth images in the folder.
    pub depth_images: usize,
    /// Radiographs in the folder.
    pub radiographs: usize,
    /// Findings about its limbs and poses.
    #[serde(skip_serializing_if = "Findings::is_empty")]
    pub findings: Findings,
    /// Poses of other settings that were replaced.
    pub replaced: usize,
    /// Poses that were removed because they are not in the plan or the shard.
    pub removed: usize,
    /// Files that were missing or altered and were made again, as paths from the root.
    pub healed: Vec<String>,
    /// New paths of files that were in the place of others and were not written by ppa, or altered since.
    pub set_aside: Vec<String>,
}

impl Summary {
    /// Summary of a dataset with the given lists, in which nothing was replaced.
    pub(crate) fn new(pose_jobs: usize, made: usize, lists: Lists) -> Self {
        let count = |kind| lists.rows.iter().filter(|row| row.kind == kind).count();
        Self {
            pose_jobs,
            made,
            depth_images: count(FileKind::Depth),
            radiographs: count(FileKind::Radiograph),
            findings: lists.findings,
            replaced: 0,
            removed: 0,
            healed: Vec::new(),
            set_aside: Vec::new(),
        }
    }
}

/// Progress reports of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Progress<'a> {
    /// The findings about the limbs, reported first.
    Findings(&'a Findings),
    /// The number of poses, before the first of them.
    Total(usize),
    /// Another pose was found complete.
    Found,
    /// Another pose was made.
    Made,
}

/// Why a run ended before its last pose. Finished poses stay and are not made again.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JobError {
    /// The folder cannot be used.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The images would exceed the disk limit.
    #[error(
        "the images in {} would take more than {limit} bytes, of which {used} are used; raise the disk limit and run \
         again to go on",
        root.display()
    )]
    DiskLimit {
        /// The dataset's folder.
        root: PathBuf,
        /// Disk limit, bytes.
        limit: u64,
        /// Size of the finished images, bytes.
        used: u64,
    },
}

/// Makes one pose of a limb: complete files in the staging folder of the dataset.
pub(crate) type MakePose<'a, E> = Box<dyn Fn(PoseJob) -> Result<Images, E> + Sync + 'a>;

/// Pose jobs, their folder and its disk limit.
pub(crate) struct Job<'a> {
    pub root: &'a Path,
    /// `dataset.json`, the same for all parts.
    pub description: &'a str,
    pub part: Part,
    pub limbs: Vec<LimbJobs>,
    pub disk_limit: Option<u64>,
    /// Whether poses of other settings are replaced, and those of other plans removed.
    pub replace: bool,
    pub progress: &'a (dyn Fn(Progress) + Sync),
    /// Whether poses are made one after another, each on all threads, so that a thread that waits within a pose does not start another one.
    pub one_by_one: bool,
    /// Called after each pose that was made, once it is in its place.
    pub kept: &'a (dyn Fn(PoseId, &Record) -> Result<(), FileError> + Sync),
}

impl Job<'_> {
    /// Makes the missing poses, several poses and limbs at a time; `prepare` is called once per limb.
    pub fn complete<'m, E: From<JobError> + Send>(
        &self,
        prepare: impl Fn(&LimbJobs) -> Result<MakePose<'m, E>, E> + Sync,
    ) -> Result<Summary, E> {
        let staging = Staging::new(self.root);
        let overview = Overview::new(self.root, self.description, self.part, &staging);
        let (_lock, survey) = self.begin(&overview).map_err(JobError::from)?;
        let pose_jobs = self.limbs.iter().map(|limb| limb.poses.len()).sum();
        (self.progress)(Progress::Total(pose_jobs));

        let used = AtomicU64::new(0);
        let mut unfinished = Vec::new();
        for limb in &self.limbs {
            let missing = self.missing(limb, &overview, &used);
            let missing = missing.map_err(JobError::from)?;
            if !missing.is_empty() {
                unfinished.push((limb, missing));
            }
        }
        if self.one_by_one {
            for (limb, missing) in &unfinished {
                let make = prepare(limb)?;
                for &pose in missing {
                    self.make(&limb.pose_job(pose), &make, &overview, &used)?;
                }
            }
        } else {
            for_each_limb(&unfinished, |_, (limb, missing)| {
                let make = prepare(limb)?;
                missing
                    .par_iter()
                    .try_for_each(|&pose| self.make(&limb.pose_job(pose), &make, &overview, &used))
            })?;
        }
        let made = unfinished.iter().map(|(_, missing)| missing.len()).sum();
        self.remove_others(&survey, &overview)
            .map_err(JobError::from)?;
        let lists = self.finish(&overview).map_err(JobError::from)?;
        Ok(Summary {
            replaced: survey.stale.len(),
            removed: survey.beyond.len(),
            healed: overview.into_healed(),
            set_aside: staging.aside.into_kept(),
            ..Summary::new(pose_jobs, made, lists)
        })
    }

    /// Locks the folder, completes the poses of a killed run, and refuses changes that require `replace`.
    fn begin(&self, overview: &Overview) -> Result<(DatasetLock, Survey), FolderError> {
        let lock = lock(self.root)?;
        require_part(self.root, self.part)?;
        overview.staging.recover()?;
        let survey = Survey::of(self.root, &self.limbs)?;
        if let Some(differs) = survey.differs(self.root, self.description)
            && !self.replace
        {
            return Err(FolderError::Differs(Box::new(differs)));
        }
        if !survey.replaces() && !self.root.join(DESCRIPTION_FILE).exists() {
            overview.describe()?;
        }
        Ok((lock, survey))
    }

    /// Returns the incomplete poses; adds the bytes of all existing images to `used`.
    fn missing(
        &self,
        limb: &LimbJobs,
        overview: &Overview,
        used: &AtomicU64,
    ) -> Result<Vec<PoseAngle>, FileError> {
        let lacks = |&pose: &PoseAngle| {
            let pose_job = limb.pose_job(pose);
            match self.look(&pose_job)? {
                FoundRecord::Absent => {}
                FoundRecord::Damaged => overview.add_healed([pose_job.id().record_file()]),
                FoundRecord::Whole(record) => {
                    used.fetch_add(record.size_of_rest(self.root), Ordering::Relaxed);
                    if record.key == pose_job.key() {
                        let damaged = record.damaged_images(self.root);
                        if damaged.is_empty() {
                            (self.progress)(Progress::Found);
                            return Ok(None);
                        }
                        overview.add_healed(damaged);
                    }
                }
            }
            Ok(Some(pose))
        };
        let poses = limb.poses.par_iter();
        poses.filter_map(|pose| lacks(pose).transpose()).collect()
    }

    fn look(&self, pose_job: &PoseJob) -> Result<FoundRecord, FileError> {
        Record::look(&self.root.join(pose_job.id().record_file()), pose_job.id())
    }

    fn make<E: From<JobError>>(
        &self,
        pose_job: &PoseJob,
        make: &MakePose<E>,
        overview: &Overview,
        used: &AtomicU64,
    ) -> Result<(), E> {
        let Images {
            files,
            rois,
            findings,
        } = make(*pose_job)?;
        let record = Record {
            key: pose_job.key(),
            files,
            rois,
            findings,
        };
        self.keep(pose_job, &record, overview, used)?;
        (self.progress)(Progress::Made);
        Ok(())
    }

    /// Moves a pose into place, or removes its images if they exceed the disk limit.
    fn keep(
        &self,
        pose_job: &PoseJob,
        record: &Record,
        overview: &Overview,
        used: &AtomicU64,
    ) -> Result<(), JobError> {
        let earlier = self.look(pose_job)?;
        let earlier = earlier.whole().map_or(0, |old| old.size_of_rest(self.root));
        let size = record.size(&staging_folder(self.root))?;
        let before = used.fetch_add(size, Ordering::Relaxed);
        if let Some(limit) = self.disk_limit
            && (before + size).saturating_sub(earlier) > limit
        {
            used.fetch_sub(size, Ordering::Relaxed);
            overview.staging.discard(record)?;
            return Err(JobError::DiskLimit {
                root: self.root.to_owned(),
                limit,
                used: before,
            });
        }
        overview.open(&self.limbs)?;
        overview.staging.put(pose_job.id(), record)?;
        (self.kept)(pose_job.id(), record)?;
        used.fetch_sub(earlier, Ordering::Relaxed);
        Ok(())
    }

    /// Removes the poses that are not in the run, once all others are complete.
    fn remove_others(&self, survey: &Survey, overview: &Overview) -> Result<(), FileError> {
        if !survey.beyond.is_empty() {
            overview.open(&self.limbs)?;
        }
        for &pose in &survey.beyond {
            overview.staging.remove(pose)?;
        }
        // A plan with fewer body shapes leaves folders without images.
        for file in survey.stale.iter().flat_map(|pose| pose.images()) {
            overview.staging.remove_empty_folders(&file);
        }
        Ok(())
    }

    /// Writes the lists of all poses: regions of interest, findings and manifest.
    fn finish(&self, overview: &Overview) -> Result<Lists, FileError> {
        let record = |pose_job: &PoseJob| Record::read(self.root, pose_job);
        let lists = Lists::of(&self.limbs, self.description, record)?;
        overview.close(&lists)?;
        overview.staging.clear()?;
        Ok(lists)
    }
}
