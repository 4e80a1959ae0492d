//! Shards joined to one dataset: the same bytes as a run over the whole plan.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use crate::pose_id::PoseId;
use ppa_core::Part;
use ppa_dataset::files::{FileError, hex, write_whole};
use ppa_dataset::stop::{Stopped, go_on};
use sha2::{Digest, Sha256};

use crate::dataset_lock::{FolderError, lock_existing};
use crate::differences::differences;
use crate::job::{Job, JobError, Progress, Summary};
use crate::limb_jobs::LimbJobs;
use crate::planned::Planned;
use crate::posable_limb::Images;
use crate::pose_id::FOLDER;
use crate::record::{FoundRecord, PoseJob, Record, record_names};
use crate::staging::staging_folder;

/// Why shards could not be joined.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MergeError {
    /// A shard's folder.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// A file of a shard.
    #[error(transparent)]
    File(#[from] FileError),
    /// The merged dataset.
    #[error(transparent)]
    Job(#[from] JobError),
    /// It was asked to stop.
    #[error("the merge ended before its last pose")]
    Stopped(#[from] Stopped),
    /// No folder was given.
    #[error("no shard to merge: name at least one folder")]
    NoShard,
    /// A shard would be merged into itself.
    #[error("{} is one of the shards; merge them into another folder", .0.display())]
    IntoShard(PathBuf),
    /// Shards that do not belong together.
    #[error("{} and {} are of different datasets: {key} differs", first.display(), second.display())]
    OtherDataset {
        /// A shard.
        first: PathBuf,
        /// Another shard.
        second: PathBuf,
        /// Key in `dataset.json`.
        key: String,
    },
    /// Two shards hold the same pose.
    #[error("both {} and {} hold {pose_job}", first.display(), second.display())]
    Overlap {
        /// A shard.
        first: PathBuf,
        /// Another shard.
        second: PathBuf,
        /// The pose.
        pose_job: String,
    },
    /// Poses that no shard holds.
    #[error("no shard holds {pose_job}; missing are {missing} of {}", ppa_core::text::count(*pose_jobs, "pose"))]
    Hole {
        /// The first of them.
        pose_job: String,
        /// Their number.
        missing: usize,
        /// Poses of the plan.
        pose_jobs: usize,
    },
    /// A pose was made from other settings than its shard's `dataset.json` states.
    #[error("{pose_job} in {} was made from other settings; run ppa generate for this shard again", shard.display())]
    Stale {
        /// The shard.
        shard: PathBuf,
        /// The pose.
        pose_job: String,
    },
    /// A record of a shard is not as it was written.
    #[error("the record of {pose_job} in {} is damaged; run ppa generate for this shard again", shard.display())]
    Damaged {
        /// The shard.
        shard: PathBuf,
        /// The pose.
        pose_job: String,
    },
    /// An image of a shard is not the one that was made.
    #[error("{} is altered: its hash is not the recorded one", .0.display())]
    Altered(PathBuf),
}

/// Joins the shards of one plan in the folder `root`, copying their images.
///
/// Every image is compared with its recorded hash before it is written. What is there already is
/// kept, so a merge that was killed can be repeated. Another dataset in `root` is refused, or made this one where `replace` is
/// set, as by [`generate`](crate::generate). Once `stop` is true no other pose begins.
///
/// # Errors
/// [`MergeError`]; shards of different plans, overlaps and holes are refused before anything is
/// written.
pub fn merge(
    shards: &[PathBuf],
    root: &Path,
    replace: bool,
    stop: &AtomicBool,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Summary, MergeError> {
    let shards = Shards::open(shards, root)?;
    let limbs = shards.planned.part(Part::WHOLE);
    shards.require_all(&limbs)?;
    let job = Job {
        root,
        description: &shards.planned.text,
        part: Part::WHOLE,
        limbs,
        disk_limit: None,
        replace,
        progress,
    };
    let staging = staging_folder(root);
    job.complete(|_| {
        Ok(Box::new(|pose_job: PoseJob| {
            go_on(stop)?;
            shards.copy(&pose_job, &staging)
        }))
    })
}

struct Shards<'a> {
    planned: Planned,
    /// The folder that holds the record of a pose.
    holder: HashMap<PoseId, &'a Path>,
}

impl<'a> Shards<'a> {
    fn open(folders: &'a [PathBuf], root: &Path) -> Result<Self, MergeError> {
        let first = folders.first().ok_or(MergeError::NoShard)?;
        let planned = Planned::read(first)?;
        let of_dataset = planned.part(Part::WHOLE);
        let pose_jobs = of_dataset.iter().flat_map(LimbJobs::pose_jobs);
        let pose_jobs: HashMap<_, _> = pose_jobs
            .map(|pose_job| (pose_job.id(), pose_job))
            .collect();
        let mut holder = HashMap::new();
        for folder in folders {
            if same_folder(folder, root) {
                return Err(MergeError::IntoShard(root.to_owned()));
            }
            let other = Planned::read(folder)?;
            if planned.text != other.text {
                let key = differences(&planned.text, &other.text).into_iter().next();
                return Err(MergeError::OtherDataset {
                    first: first.clone(),
                    second: folder.clone(),
                    key: key.map_or("the text of dataset.json".to_owned(), |key| key.key),
                });
            }
            // Refuses a shard that is written now. The lock is not kept, since there may be more shards than files may be open;
            // a pose that changes later fails by its hash.
            lock_existing(folder)?;
            for pose in record_names(&folder.join(FOLDER))? {
                let Some(pose_job) = pose_jobs.get(&pose) else {
                    let (root, record) = (folder.clone(), pose.record_name());
                    return Err(FolderError::OtherPlan { root, record }.into());
                };
                if let Some(first) = holder.insert(pose, folder.as_path()) {
                    return Err(MergeError::Overlap {
                        first: first.to_owned(),
                        second: folder.clone(),
                        pose_job: pose_job.to_string(),
                    });
                }
            }
        }
        Ok(Self { planned, holder })
    }

    fn require_all(&self, limbs: &[LimbJobs]) -> Result<(), MergeError> {
        let pose_jobs = || limbs.iter().flat_map(LimbJobs::pose_jobs);
        let missing = || pose_jobs().filter(|pose_job| !self.holder.contains_key(&pose_job.id()));
        match missing().next() {
            None => Ok(()),
            Some(pose_job) => Err(MergeError::Hole {
                pose_job: pose_job.to_string(),
                missing: missing().count(),
                pose_jobs: pose_jobs().count(),
            }),
        }
    }

    /// Copies the images of one pose from the shard that holds it below `to`.
    fn copy(&self, pose_job: &PoseJob, to: &Path) -> Result<Images, MergeError> {
        let shard = self.holder[&pose_job.id()];
        let found = Record::look(&shard.join(pose_job.id().record_file()), pose_job.id())?;
        let FoundRecord::Whole(Record {
            key,
            files,
            rois,
            findings,
        }) = found
        else {
            return Err(MergeError::Damaged {
                shard: shard.to_owned(),
                pose_job: pose_job.to_string(),
            });
        };
        if key != pose_job.key() {
            return Err(MergeError::Stale {
                shard: shard.to_owned(),
                pose_job: pose_job.to_string(),
            });
        }
        for row in &files {
            let path = shard.join(&row.file);
            let bytes =
                ppa_core::regular_file::read(&path).map_err(FileError::at("read", &path))?;
            if hex(&Sha256::digest(&bytes)) != row.sha256 {
                return Err(MergeError::Altered(path));
            }
            write_whole(&to.join(&row.file), &bytes)?;
        }
        Ok(Images {
            files,
            rois,
            findings,
        })
    }
}

fn same_folder(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}
