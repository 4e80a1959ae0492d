//! The shards of a dataset, made by other machines.

use std::path::{Path, PathBuf};

use ppa_cluster::{ClusterFolder, Submission, Work};
use ppa_core::Part;
use ppa_dataset::files::FileError;
use ppa_generate::status;
use serde::Serialize;

use crate::error::StudioError;

/// Progress of a shard according to its files.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub(crate) struct ShardState {
    /// Shard and count, such as `2/8`.
    pub shard: String,
    pub pose_jobs: usize,
    pub made: usize,
    /// Whether a process is writing into its folder.
    pub running: bool,
    pub complete: bool,
}

/// Returns the shards of a dataset in order: those of `ppa submit`, or the folders next to it named as by `ppa generate --shard`.
pub(crate) fn shards(root: &Path) -> Result<Vec<ShardState>, StudioError> {
    let folders = if ClusterFolder::is_one(root) {
        of_cluster(root)?
    } else {
        beside(root)?
    };
    Ok(folders
        .into_iter()
        .map(|(part, folder)| state(part, &folder))
        .collect())
}

fn of_cluster(root: &Path) -> Result<Vec<(Part, PathBuf)>, StudioError> {
    let folder = ClusterFolder::open(root)?;
    let submission = Submission::read(&folder.submission())?;
    let Some(Work::Poses(work)) = submission.map(|submission| submission.work) else {
        return Ok(Vec::new());
    };
    let count = work.bundle.shards;
    let parts = (1..=count).filter_map(|number| {
        let part: Part = format!("{number}/{count}").parse().ok()?;
        Some((part, folder.shard(&work, number)))
    });
    Ok(parts.collect())
}

/// Finds folders such as `dataset_2_of_8` next to `dataset`.
fn beside(root: &Path) -> Result<Vec<(Part, PathBuf)>, StudioError> {
    let name = root.file_name().unwrap_or_default().to_string_lossy();
    let parent = root.parent().unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(parent).map_err(FileError::at("read", parent))?;
    let mut found: Vec<(Part, PathBuf)> = entries
        .filter_map(|entry| {
            let path = entry.ok()?.path();
            let of = path.file_name()?.to_str()?.strip_prefix(&*name)?;
            let part = of.strip_prefix('_')?.replace("_of_", "/").parse().ok()?;
            Some((part, path))
        })
        .collect();
    found.sort_by_key(|(part, _)| part.index());
    Ok(found)
}

fn state(part: Part, folder: &Path) -> ShardState {
    // A missing or damaged folder counts as empty.
    let found = status(folder).ok();
    ShardState {
        shard: part.to_string(),
        pose_jobs: found.as_ref().map_or(0, |found| found.pose_jobs),
        made: found.as_ref().map_or(0, |found| found.made),
        running: found.as_ref().is_some_and(|found| found.running),
        complete: found.is_some_and(|found| found.complete),
    }
}
