//! Comparison of a folder's content with the planned poses of a run.

use std::collections::{HashMap, HashSet};
use std::fmt;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::pose_id::PoseId;
use ppa_core::text::count;
use ppa_dataset::files::FileError;
use ppa_dataset::manifest::DESCRIPTION_FILE;
use rayon::prelude::*;

use crate::differences::{KeyDifference, differences};
use crate::limb_jobs::LimbJobs;
use crate::pose_id::FOLDER;
use crate::record::{Record, record_names};

/// A folder holds a dataset of other settings, poses or images than those of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DatasetDiffers {
    /// The dataset's folder.
    pub root: PathBuf,
    /// Poses that it holds.
    pub poses: usize,
    /// Of these, the ones made from other settings, scans or sources.
    pub stale: usize,
    /// Keys of `dataset.json` in which the run differs, most important first.
    pub keys: Vec<KeyDifference>,
    /// Poses in the folder that are not in the run: the first in words, and their number.
    pub beyond: Option<(String, usize)>,
    /// Images at paths of the run that no record lists: the first, and their number.
    pub unrecorded: Option<(String, usize)>,
}

impl fmt::Display for DatasetDiffers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const TOLD: usize = 3;
        let mut parts = Vec::new();
        if self.stale > 0 {
            let mut keys: Vec<_> = self
                .keys
                .iter()
                .take(TOLD)
                .map(ToString::to_string)
                .collect();
            match self.keys.len() {
                0 => keys.push(
                    "not those in its dataset.json, because a run with --replace was interrupted"
                        .to_owned(),
                ),
                n if n > TOLD => keys.push(format!("{} more keys", n - TOLD)),
                _ => {}
            }
            let (stale, keys) = (self.stale, keys.join(", "));
            parts.push(format!(
                "{stale} of its {} were made from other inputs ({keys})",
                count(self.poses, "pose")
            ));
        }
        if let Some((first, n)) = &self.beyond {
            parts.push(format!(
                "{} of it, the first {first}, {} not in this run",
                count(*n, "pose"),
                are(*n)
            ));
        }
        if let Some((first, n)) = &self.unrecorded {
            parts.push(format!(
                "{}, the first {first}, {} not in any of its records",
                count(*n, "image"),
                are(*n)
            ));
        }
        write!(
            f,
            "{} holds another dataset: {}; --replace replaces what differs, --out names another folder",
            self.root.display(),
            parts.join("; ")
        )
    }
}

fn are(count: usize) -> &'static str {
    if count == 1 { "is" } else { "are" }
}

/// Content of a folder that a run is to fill.
pub(crate) struct Survey {
    poses: usize,
    /// Poses of the run whose record has another key.
    pub stale: HashSet<PoseId>,
    /// Recorded poses that are not in the run, in the order of their names.
    pub beyond: Vec<PoseId>,
    unrecorded: Vec<String>,
}

impl Survey {
    /// Reads the records in `root`.
    pub fn of(root: &Path, limbs: &[LimbJobs]) -> Result<Self, FileError> {
        let pose_jobs = limbs.iter().flat_map(LimbJobs::pose_jobs);
        let pose_jobs: HashMap<_, _> = pose_jobs
            .map(|pose_job| (pose_job.id(), pose_job))
            .collect();
        let recorded = record_names(&root.join(FOLDER))?;
        let is_stale = |pose: &PoseId| {
            let Some(pose_job) = pose_jobs.get(pose) else {
                return Ok(None);
            };
            let found = Record::look(&root.join(pose.record_file()), *pose)?;
            let stale = found
                .whole()
                .is_some_and(|record| record.key != pose_job.key());
            Ok(stale.then_some(*pose))
        };
        let stale = recorded
            .par_iter()
            .filter_map(|pose| is_stale(pose).transpose());
        let stale = stale.collect::<Result<_, FileError>>()?;
        let unrecorded = unrecorded(root, limbs, &recorded.iter().copied().collect())?;
        Ok(Self {
            poses: recorded.len(),
            stale,
            beyond: recorded
                .into_iter()
                .filter(|pose| !pose_jobs.contains_key(pose))
                .collect(),
            unrecorded,
        })
    }

    /// How the folder differs from a run with the given `dataset.json`; `None` if the run would only add to it.
    pub fn differs(&self, root: &Path, description: &str) -> Option<DatasetDiffers> {
        let same = self.stale.is_empty() && self.beyond.is_empty() && self.unrecorded.is_empty();
        let there = || fs::read_to_string(root.join(DESCRIPTION_FILE)).unwrap_or_default();
        (!same).then(|| DatasetDiffers {
            root: root.to_owned(),
            poses: self.poses,
            stale: self.stale.len(),
            keys: differences(&there(), description),
            beyond: self
                .beyond
                .first()
                .map(|pose| (pose.to_string(), self.beyond.len())),
            unrecorded: self
                .unrecorded
                .first()
                .map(|file| (file.clone(), self.unrecorded.len())),
        })
    }

    /// Whether the run changes more than it adds.
    pub fn replaces(&self) -> bool {
        !(self.stale.is_empty() && self.beyond.is_empty())
    }
}

/// Images at paths of planned ones, without a record.
fn unrecorded(
    root: &Path,
    limbs: &[LimbJobs],
    recorded: &HashSet<PoseId>,
) -> Result<Vec<String>, FileError> {
    let mut found = Vec::new();
    for limb in limbs {
        let poses = limb.pose_jobs().map(|pose_job| pose_job.id());
        let poses: Vec<_> = poses.filter(|pose| !recorded.contains(pose)).collect();
        let Some(first) = poses.first() else { continue };
        let mut there = HashSet::new();
        let folders: HashSet<_> = first
            .images()
            .iter()
            .filter_map(|file| parent(file))
            .collect();
        for folder in folders {
            for name in file_names(&root.join(&folder))? {
                there.insert(format!("{folder}/{name}"));
            }
        }
        if !there.is_empty() {
            let images = poses.iter().flat_map(|pose| pose.images());
            found.extend(images.filter(|file| there.contains(file)));
        }
    }
    Ok(found)
}

fn parent(file: &str) -> Option<String> {
    file.rsplit_once('/').map(|(folder, _)| folder.to_owned())
}

fn file_names(folder: &Path) -> Result<Vec<String>, FileError> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries,
    };
    let names = entries.and_then(|entries| {
        let names = entries.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()));
        names.collect::<io::Result<Vec<_>>>()
    });
    names.map_err(FileError::at("read", folder))
}
