//! Merges shards into one dataset: the same bytes as a run of the whole plan.

use std::cell::RefCell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use ppa_core::Part;
use ppa_dataset::archive::is_archive;
use ppa_dataset::files::{FileError, hex, write_whole};
use ppa_dataset::manifest::{DESCRIPTION_FILE, FileRow};
use ppa_dataset::stop::{Stopped, go_on};
use sha2::{Digest, Sha256};

use crate::dataset_files::DatasetFiles;
use crate::dataset_lock::{FolderError, lock_archive, lock_existing};
use crate::differences::differences;
use crate::job::{Job, JobError, Progress, Summary};
use crate::keep_damaged::keep_damaged;
use crate::limb_jobs::LimbJobs;
use crate::lists::Lists;
use crate::planned::Planned;
use crate::posable_limb::Images;
use crate::pose_id::PoseId;
use crate::record::{FoundRecord, PoseJob, Record};
use crate::staging::staging_folder;
use crate::write_archive::{NamedBytes, write_archive};

/// Why shards could not be merged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MergeError {
    /// The folder of a shard cannot be used.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// A file of a shard cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The merged dataset.
    #[error(transparent)]
    Job(#[from] JobError),
    /// The merge was asked to stop.
    #[error("the merge ended before its last pose")]
    Stopped(#[from] Stopped),
    /// No folder was given.
    #[error("no shard to merge: name at least one folder")]
    NoShard,
    /// The archive to write exists.
    #[error(
        "{} exists and does not hold the dataset of these shards; --replace replaces it, --out names another one",
        .0.display()
    )]
    Exists(PathBuf),
    /// A shard would be merged into itself.
    #[error("{} is one of the shards; merge them into another folder", .0.display())]
    IntoShard(PathBuf),
    /// Shards belong to different datasets.
    #[error("{} and {} belong to different datasets: {key} differs", first.display(), second.display())]
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
    /// No shard holds some of the poses.
    #[error("no shard holds {pose_job}; {missing} of {} are missing", ppa_core::text::count(*pose_jobs, "pose"))]
    Hole {
        /// The first missing pose.
        pose_job: String,
        /// Number of missing poses.
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
    /// An image of a shard was altered.
    #[error("{} is altered: its hash does not match the recorded one", .0.display())]
    Altered(PathBuf),
}

/// Merges the shards of one plan into the folder `root`, copying their images, or into the tar archive of this path if it ends in `.tar`.
/// Shards may be folders and archives.
///
/// Every image is compared with its recorded hash before it is written. Existing poses are kept, so a killed merge can be repeated; an
/// archive is written whole or not at all. Another dataset in `root` is refused, or replaced if `replace` is set, as by
/// [`generate`](crate::generate). Once `stop` is true no other pose begins.
///
/// # Errors
/// [`MergeError`]; shards of different plans, overlaps and missing poses are refused before anything is written.
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
    if is_archive(root) {
        return shards.merge_into_archive(&limbs, root, replace, stop, progress);
    }
    let job = Job {
        root,
        description: &shards.planned.text,
        part: Part::WHOLE,
        limbs,
        disk_limit: None,
        replace,
        progress,
        one_by_one: false,
        kept: &|_, _| Ok(()),
    };
    let staging = staging_folder(root);
    job.complete(|_| {
        Ok(Box::new(|pose_job: PoseJob| {
            go_on(stop)?;
            let (record, images) = shards.pose(&pose_job)?;
            for (file, bytes) in images {
                write_whole(&staging.join(file), &bytes)?;
            }
            Ok(Images {
                files: record.files,
                rois: record.rois,
                findings: record.findings,
            })
        }))
    })
}

struct Shards {
    planned: Planned,
    files: Vec<DatasetFiles>,
    /// Index of the shard that holds the record of a pose.
    holder: HashMap<PoseId, usize>,
}

impl Shards {
    fn open(folders: &[PathBuf], root: &Path) -> Result<Self, MergeError> {
        let mut files: Vec<DatasetFiles> = Vec::new();
        let mut first: Option<Planned> = None;
        let mut pose_jobs = HashMap::new();
        let mut holder = HashMap::new();
        for (index, folder) in folders.iter().enumerate() {
            if same_folder(folder, root) {
                return Err(MergeError::IntoShard(root.to_owned()));
            }
            // Refuses a shard that is being written. The lock is not kept, since there may be more shards than files may be open; a pose
            // that changes later fails its hash check.
            lock_existing(folder)?;
            let shard = DatasetFiles::open(folder)?;
            if shard.is_empty_archive() {
                return Err(FolderError::NotADataset(folder.clone()).into());
            }
            let planned = shard.planned()?;
            match &first {
                None => {
                    for limb in planned.part(Part::WHOLE) {
                        let names = limb.pose_jobs().map(|one| (one.id(), one.to_string()));
                        pose_jobs.extend(names);
                    }
                    first = Some(planned);
                }
                Some(first) if first.text != planned.text => {
                    let key = differences(&first.text, &planned.text).into_iter().next();
                    return Err(MergeError::OtherDataset {
                        first: folders[0].clone(),
                        second: folder.clone(),
                        key: key.map_or("the text of dataset.json".to_owned(), |key| key.key),
                    });
                }
                Some(_) => {}
            }
            for pose in shard.poses()? {
                let Some(name) = pose_jobs.get(&pose) else {
                    let (root, record) = (folder.clone(), pose.record_name());
                    return Err(FolderError::OtherPlan { root, record }.into());
                };
                if let Some(first) = holder.insert(pose, index) {
                    return Err(MergeError::Overlap {
                        first: folders[first].clone(),
                        second: folder.clone(),
                        pose_job: name.clone(),
                    });
                }
            }
            files.push(shard);
        }
        Ok(Self {
            planned: first.ok_or(MergeError::NoShard)?,
            files,
            holder,
        })
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

    /// The record of a pose and its images, from the shard that holds it.
    fn pose(&self, pose_job: &PoseJob) -> Result<(Record, Vec<NamedBytes>), MergeError> {
        let shard = &self.files[self.holder[&pose_job.id()]];
        let FoundRecord::Whole(record) = shard.look(pose_job.id())? else {
            return Err(MergeError::Damaged {
                shard: shard.root().to_owned(),
                pose_job: pose_job.to_string(),
            });
        };
        if record.key != pose_job.key() {
            return Err(MergeError::Stale {
                shard: shard.root().to_owned(),
                pose_job: pose_job.to_string(),
            });
        }
        let image = |row: &FileRow| {
            let bytes = shard.required(&row.file)?;
            match hex(&Sha256::digest(&bytes)) == row.sha256 {
                true => Ok((row.file.clone(), bytes)),
                false => Err(MergeError::Altered(shard.path(&row.file))),
            }
        };
        let images = record.files.iter().map(image);
        let images = images.collect::<Result<_, MergeError>>()?;
        Ok((record, images))
    }

    /// Writes the dataset as one archive, pose by pose in the order of the plan.
    fn merge_into_archive(
        &self,
        limbs: &[LimbJobs],
        root: &Path,
        replace: bool,
        stop: &AtomicBool,
        progress: &(dyn Fn(Progress) + Sync),
    ) -> Result<Summary, MergeError> {
        let pose_jobs = || limbs.iter().flat_map(LimbJobs::pose_jobs);
        progress(Progress::Total(pose_jobs().count()));
        let mut set_aside = Vec::new();
        let exists = root.exists();
        let _lock = exists.then(|| lock_archive(root)).transpose()?;
        if exists {
            match self.merged_before(limbs, root)? {
                Merged::Whole(records) => {
                    pose_jobs().for_each(|_| progress(Progress::Found));
                    return Ok(self.summary(limbs, records, 0));
                }
                Merged::Damaged => set_aside.push(keep_damaged(root)?.display().to_string()),
                Merged::Other if replace => {}
                Merged::Other => return Err(MergeError::Exists(root.to_owned())),
            }
        }
        let records = RefCell::new(Vec::new());
        let poses = pose_jobs().map(|pose_job| {
            go_on(stop)?;
            let (record, mut files) = self.pose(&pose_job)?;
            let text = record.to_text().into_bytes();
            files.push((pose_job.id().record_file(), text));
            records.borrow_mut().push(record);
            progress(Progress::Made);
            Ok(files)
        });
        let description = self.planned.text.clone().into_bytes();
        let lists = || {
            let lists = self.lists(limbs, records.borrow().clone()).files;
            let bytes = lists
                .into_iter()
                .map(|(name, text)| (name, text.into_bytes()));
            Ok::<_, MergeError>(bytes.collect())
        };
        let stated = [(DESCRIPTION_FILE.to_owned(), description)];
        write_archive(root, &stated, poses, lists)?;
        Ok(Summary {
            set_aside,
            ..self.summary(limbs, records.into_inner(), pose_jobs().count())
        })
    }

    /// Compares an archive with the merged dataset: its records with the plan, images with their hashes, lists with the records.
    fn merged_before(&self, limbs: &[LimbJobs], root: &Path) -> Result<Merged, MergeError> {
        let files = DatasetFiles::open(root)?;
        if files.is_empty_archive() || files.planned()?.text != self.planned.text {
            return Ok(Merged::Other);
        }
        if !files.is_finished_archive() {
            return Ok(Merged::Damaged);
        }
        let mut records = Vec::new();
        for pose_job in limbs.iter().flat_map(LimbJobs::pose_jobs) {
            match files.look(pose_job.id())? {
                FoundRecord::Whole(record) if record.key == pose_job.key() => records.push(record),
                _ => return Ok(Merged::Damaged),
            }
        }
        let hash =
            |file: &str| Ok::<_, FileError>(files.read(file)?.map(|b| hex(&Sha256::digest(b))));
        for row in records.iter().flat_map(|record| &record.files) {
            if hash(&row.file)?.as_deref() != Some(&*row.sha256) {
                return Ok(Merged::Damaged);
            }
        }
        for (file, text) in self.lists(limbs, records.clone()).files {
            if files.read(&file)? != Some(text.into_bytes()) {
                return Ok(Merged::Damaged);
            }
        }
        Ok(Merged::Whole(records))
    }

    fn lists(&self, limbs: &[LimbJobs], records: Vec<Record>) -> Lists {
        let mut records = records.into_iter();
        let next = |_: &PoseJob| records.next().ok_or(());
        Lists::of(limbs, &self.planned.text, next).expect("each pose has a record")
    }

    fn summary(&self, limbs: &[LimbJobs], records: Vec<Record>, made: usize) -> Summary {
        let pose_jobs = records.len();
        let lists = self.lists(limbs, records);
        Summary::new(pose_jobs, made, lists)
    }
}

/// Content of an existing archive.
enum Merged {
    /// The merged dataset.
    Whole(Vec<Record>),
    /// The merged dataset, but damaged or incomplete.
    Damaged,
    /// Another dataset.
    Other,
}

fn same_folder(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}
