//! Checks a dataset for completeness: images, records and lists against each other.

use std::path::{Path, PathBuf};

use ppa_dataset::checksums::Checksums;
use ppa_dataset::files::{read_text, sha256_of_file};
use ppa_dataset::findings::Findings;
use ppa_dataset::manifest::{FileRow, Manifest};
use rayon::prelude::*;

use crate::dataset_files::DatasetFiles;
use crate::dataset_lock::{DatasetLock, FolderError, lock_existing};
use crate::limb_jobs::LimbJobs;
use crate::lists::{Lists, stands};
use crate::planned::Planned;
use crate::record::{FoundRecord, PoseJob, Record};
use crate::staging::is_interrupted;

/// Something in a dataset that is not as it was made.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// A pose was never made, or its record is gone.
    #[error("{pose_job} is missing")]
    Missing {
        /// The pose.
        pose_job: String,
    },
    /// The record of a pose is not as it was written.
    #[error("the record of {pose_job} is damaged")]
    Record {
        /// The pose.
        pose_job: String,
    },
    /// A run was killed while it moved the files of a pose into place.
    #[error(
        "{pose_job} is only partly replaced because the run was interrupted; the next run completes it"
    )]
    Interrupted {
        /// The pose.
        pose_job: String,
    },
    /// A pose was made from settings other than those in `dataset.json`.
    #[error("{pose_job} was made from other settings than those in dataset.json")]
    Stale {
        /// The pose.
        pose_job: String,
    },
    /// An image cannot be read.
    #[error("{file} cannot be read")]
    Unreadable {
        /// Path from the dataset's root.
        file: String,
    },
    /// The bytes of an image differ from those that were written.
    #[error("{file} is altered: its hash does not match the recorded one")]
    Altered {
        /// Path from the dataset's root.
        file: String,
    },
    /// An image or record differs when its pose is generated again.
    #[error("{file} differs when it is generated again")]
    Differs {
        /// Path from the dataset's root.
        file: String,
    },
    /// A line of the manifest is not the row of its image.
    #[error("manifest.jsonl line {line} is altered: expected the row of {expected}")]
    ManifestLine {
        /// Line number, counted from 1.
        line: usize,
        /// The image whose row is expected there, or a note that there is none.
        expected: String,
    },
    /// A list cannot be read or does not match the records.
    #[error("{file} is missing or altered")]
    List {
        /// Path from the dataset's root.
        file: String,
    },
}

impl Problem {
    /// Path of the affected image or list from the dataset's root.
    pub fn file(&self) -> Option<&str> {
        match self {
            Self::Unreadable { file }
            | Self::Altered { file }
            | Self::Differs { file }
            | Self::List { file } => Some(file),
            _ => None,
        }
    }
}

/// What [`check`] found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Check {
    /// Poses that the folder should hold.
    pub pose_jobs: usize,
    /// Images whose bytes were compared with their hash.
    pub images: usize,
    /// All problems, in the order of the plan.
    pub problems: Vec<Problem>,
}

/// A dataset locked for reading, with the poses that it should hold.
pub(crate) struct Recorded {
    _lock: DatasetLock,
    pub planned: Planned,
    pub limbs: Vec<LimbJobs>,
    /// Folder to which an archive was extracted.
    scratch: Option<tempfile::TempDir>,
    root: PathBuf,
}

impl Recorded {
    pub fn open(root: &Path) -> Result<Self, FolderError> {
        let lock = lock_existing(root)?;
        let files = DatasetFiles::open(root)?;
        let planned = files.planned()?;
        Ok(Self {
            _lock: lock,
            limbs: planned.part(files.part()?),
            planned,
            scratch: files.extracted()?,
            root: root.to_owned(),
        })
    }

    /// The folder with its files.
    pub fn folder(&self) -> &Path {
        let scratch = self.scratch.as_ref();
        scratch.map_or(&self.root, |scratch| scratch.path())
    }

    /// Compares all files with their records.
    pub fn check(&self) -> Check {
        let pose_jobs: Vec<_> = self.limbs.iter().flat_map(LimbJobs::pose_jobs).collect();
        let found: Vec<_> = pose_jobs
            .par_iter()
            .map(|pose_job| self.pose_job(pose_job))
            .collect();
        let mut problems = Vec::new();
        let mut records = Vec::new();
        for (record, of_unit) in found {
            records.extend(record);
            problems.extend(of_unit);
        }
        let images = records.iter().map(|record| record.files.len()).sum();
        // Lists are written after the last pose.
        if records.len() == pose_jobs.len() {
            problems.extend(self.lists(records));
        }
        Check {
            pose_jobs: pose_jobs.len(),
            images,
            problems,
        }
    }

    fn pose_job(&self, pose_job: &PoseJob) -> (Option<Record>, Vec<Problem>) {
        let path = self.folder().join(pose_job.id().record_file());
        let found = Record::look(&path, pose_job.id()).unwrap_or(FoundRecord::Damaged);
        let unit_name = pose_job.to_string();
        if is_interrupted(self.folder(), pose_job.id()) {
            return (
                None,
                vec![Problem::Interrupted {
                    pose_job: unit_name,
                }],
            );
        }
        let record = match found {
            FoundRecord::Whole(record) => record,
            FoundRecord::Absent => {
                return (
                    None,
                    vec![Problem::Missing {
                        pose_job: unit_name,
                    }],
                );
            }
            FoundRecord::Damaged => {
                return (
                    None,
                    vec![Problem::Record {
                        pose_job: unit_name,
                    }],
                );
            }
        };
        if record.key != pose_job.key() {
            return (
                None,
                vec![Problem::Stale {
                    pose_job: unit_name,
                }],
            );
        }
        let of_image = |row: &FileRow| {
            let file = row.file.clone();
            match sha256_of_file(&self.folder().join(&file)) {
                Err(_) => Some(Problem::Unreadable { file }),
                Ok(found) => (found != row.sha256).then_some(Problem::Altered { file }),
            }
        };
        let problems = record.files.iter().filter_map(of_image).collect();
        (Some(record), problems)
    }

    /// Compares the lists with the records, which are in the order of the plan.
    fn lists(&self, records: Vec<Record>) -> Vec<Problem> {
        let mut records = records.into_iter();
        let record = |_: &PoseJob| records.next().ok_or(());
        let lists = Lists::of(&self.limbs, &self.planned.text, record);
        let lists = lists.expect("all poses have a record");
        let mut problems = Vec::new();
        for list @ (file, text) in &lists.files {
            let is_sealed = self.planned.sealed || file != Checksums::FILE;
            if file == Manifest::FILE {
                problems.extend(self.manifest(text, &lists.rows));
            } else if is_sealed && !stands(self.folder(), list) {
                problems.push(Problem::List { file: file.clone() });
            }
        }
        if !lists.holds(Findings::FILE) && self.folder().join(Findings::FILE).exists() {
            let file = Findings::FILE.to_owned();
            problems.push(Problem::List { file });
        }
        problems
    }

    fn manifest(&self, text: &str, rows: &[FileRow]) -> Option<Problem> {
        let file = Manifest::FILE.to_owned();
        let Ok(found) = read_text(&self.folder().join(&file)) else {
            return Some(Problem::List { file });
        };
        if found == text {
            return None;
        }
        let (mut found, mut lines) = (found.lines(), text.lines());
        let same = |_: &usize| matches!((found.next(), lines.next()), (Some(a), Some(b)) if a == b);
        let line = (0..).take_while(same).count();
        let row = rows.get(line).map(|row| row.file.clone());
        Some(Problem::ManifestLine {
            line: line + 1,
            expected: row.unwrap_or_else(|| "no further image".to_owned()),
        })
    }
}

/// Reads every image of the dataset in the folder or archive `root` and compares it with its hash, and the lists with the records they were
/// made from. Changes nothing; an archive is extracted to a temporary folder.
///
/// # Errors
/// [`FolderError`] when `root` holds no dataset or is being written.
pub fn check(root: &Path) -> Result<Check, FolderError> {
    Ok(Recorded::open(root)?.check())
}
