//! Regenerates a sample of a dataset and compares it byte by byte.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use ppa_dataset::files::FileError;
use ppa_dataset::findings::Findings;
use ppa_dataset::stop::{Stopped, go_on};
use ppa_scene::PoseAngle;
use rayon::prelude::*;

use crate::check::{Check, Problem, Recorded};
use crate::dataset_lock::FolderError;
use crate::differences::differences;
use crate::generate::{GenerateError, Work};
use crate::job::{MakePose, Progress};
use crate::limb_jobs::LimbJobs;
use crate::plan::Plan;
use crate::record::{PoseJob, Record};
use crate::seed::{Purpose, item_seed};
use crate::several_limbs::for_each_limb;

/// Why a dataset could not be verified.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VerifyError {
    /// The dataset cannot be used.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The verification was asked to stop.
    #[error("not all poses of the sample were made again")]
    Stopped(#[from] Stopped),
    /// A pose cannot be made again.
    #[error(transparent)]
    Generate(#[from] GenerateError),
    /// The dataset is not that of the plan.
    #[error("{} was not made from this plan, or not by this version: {key} differs", root.display())]
    OtherPlan {
        /// The dataset's folder.
        root: PathBuf,
        /// Key in `dataset.json`.
        key: String,
    },
    /// The fraction is not between 0 and 1.
    #[error("the fraction is {0}, expected a number from 0 to 1")]
    Fraction(f64),
}

/// What [`verify`] found.
#[derive(Debug, Clone, PartialEq)]
pub struct Verification {
    /// Comparison of all files with their records.
    pub check: Check,
    /// Poses that were made again.
    pub remade: usize,
    /// Images and records of these poses that differ.
    pub different: Vec<Problem>,
    /// Findings about its limbs and poses.
    pub findings: Findings,
}

/// Checks the dataset in the folder or archive `root` as [`check`](crate::check) does, then makes a share of its poses
/// again, at least one, in a temporary folder, and compares hashes, poses and regions of interest.
///
/// `seed` selects the poses: another seed selects others. Once `stop` is true no other pose begins.
///
/// # Errors
/// [`VerifyError`] when the dataset is not that of `plan` or a pose cannot be made.
pub fn verify(
    plan: &Plan,
    root: &Path,
    fraction: f64,
    seed: u64,
    stop: &AtomicBool,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Verification, VerifyError> {
    if !(0.0..=1.0).contains(&fraction) {
        return Err(VerifyError::Fraction(fraction));
    }
    let recorded = Recorded::open(root)?;
    let work = Work::of_plan(plan)?;
    let there = &recorded.planned.text;
    if *there != work.description {
        let key = differences(there, &work.description).into_iter().next();
        return Err(VerifyError::OtherPlan {
            root: root.to_owned(),
            key: key.map_or("the text of dataset.json".to_owned(), |key| key.key),
        });
    }
    let folder = recorded.folder();
    let findings = Findings::read(folder)?;
    progress(Progress::Findings(&findings));
    let check = recorded.check();
    let sample = sample(&recorded.limbs, fraction, seed);
    let remade = sample.iter().map(|(_, poses)| poses.len()).sum();
    progress(Progress::Total(remade));
    let scratch = tempfile::tempdir().map_err(FileError::at("create", &std::env::temp_dir()))?;
    let different = for_each_limb(&sample, |_, (limb, poses)| {
        go_on(stop)?;
        let make = work.prepare(limb.limb, scratch.path(), None)?;
        let compare = |&pose: &PoseAngle| {
            go_on(stop)?;
            let found = compare(&limb.pose_job(pose), &make, folder, scratch.path())?;
            progress(Progress::Made);
            Ok::<_, VerifyError>(found)
        };
        let found = poses.par_iter().map(compare);
        Ok::<_, VerifyError>(found.collect::<Result<Vec<_>, _>>()?.concat())
    })?;
    Ok(Verification {
        check,
        remade,
        different: different.concat(),
        findings,
    })
}

/// The poses with the lowest hashes of their addresses, limb by limb.
fn sample(limbs: &[LimbJobs], fraction: f64, seed: u64) -> Vec<(&LimbJobs, Vec<PoseAngle>)> {
    let draw = |pose_job: &PoseJob| {
        item_seed(
            seed,
            Purpose::Verification,
            pose_job.limb,
            pose_job.pose.step,
        )
    };
    let pose_jobs = || limbs.iter().flat_map(LimbJobs::pose_jobs);
    let mut draws: Vec<_> = pose_jobs().map(|pose_job| draw(&pose_job)).collect();
    draws.sort_unstable();
    let count = (draws.len() as f64 * fraction).ceil().max(1.0) as usize;
    let Some(&limit) = draws.get(count.min(draws.len()).saturating_sub(1)) else {
        return Vec::new();
    };
    let chosen = |limb: &LimbJobs| {
        let pose_jobs = limb.pose_jobs().filter(|pose_job| draw(pose_job) <= limit);
        pose_jobs.map(|pose_job| pose_job.pose).collect::<Vec<_>>()
    };
    let limbs = limbs.iter().map(|limb| (limb, chosen(limb)));
    limbs.filter(|(_, poses)| !poses.is_empty()).collect()
}

/// Makes one pose again and names the images that differ from the recorded ones.
fn compare(
    pose_job: &PoseJob,
    make: &MakePose<GenerateError>,
    root: &Path,
    scratch: &Path,
) -> Result<Vec<Problem>, VerifyError> {
    let images = make(*pose_job)?;
    for row in &images.files {
        let path = scratch.join(&row.file);
        std::fs::remove_file(&path).map_err(FileError::at("remove", &path))?;
    }
    // A pose without a record is reported by the check.
    let Ok(record) = Record::read(root, pose_job) else {
        return Ok(Vec::new());
    };
    let mut different = Vec::new();
    for (i, row) in images.files.iter().enumerate() {
        if record.files.get(i) != Some(row) {
            different.push(row.file.clone());
        }
    }
    if record.files.len() > images.files.len() || record.rois != images.rois {
        different.push(pose_job.id().record_file());
    }
    let problem = |file| Problem::Differs { file };
    Ok(different.into_iter().map(problem).collect())
}

#[cfg(test)]
mod tests {
    use ppa_dataset::layout::{LimbId, Side};
    use ppa_scene::Sweep;

    use super::*;

    #[test]
    fn the_share_of_a_sample_is_the_fraction() {
        let limb = |patient| LimbJobs {
            limb: LimbId {
                patient,
                side: Side::Left,
            },
            key: String::new(),
            acknowledged: Vec::new(),
            poses: Sweep::default().poses().unwrap(),
        };
        let limbs: Vec<_> = (0..17).map(limb).collect();
        let size = |fraction, seed| {
            let sample = sample(&limbs, fraction, seed);
            sample.iter().map(|(_, poses)| poses.len()).sum::<usize>()
        };
        assert_eq!(size(0.001, 0), 4);
        assert_eq!(size(0.0, 0), 1);
        assert_eq!(size(1.0, 0), 17 * 181);
        let first = |seed| {
            let sample = sample(&limbs, 0.0, seed);
            (sample[0].0.limb.patient, sample[0].1[0].step)
        };
        assert_ne!(first(1), first(2), "another seed looks elsewhere");
        assert!(sample(&[], 0.5, 0).is_empty());
    }
}
