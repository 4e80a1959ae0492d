//! Progress of a dataset: poses done, missing and damaged.

use std::path::Path;

use ppa_dataset::layout::LimbId;
use ppa_dataset::manifest::Manifest;
use serde::Serialize;

use crate::dataset_files::DatasetFiles;
use crate::dataset_lock::{FolderError, lock_existing};
use crate::limb_jobs::LimbJobs;
use crate::record::FoundRecord;

/// State of a dataset, from its records; its images are not read (see [`crate::check`]).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Status {
    /// Part of its plan that the folder should hold, such as `2/8`.
    pub part: String,
    /// Poses that the folder should hold.
    #[serde(rename = "units")]
    pub pose_jobs: usize,
    /// Finished poses.
    pub made: usize,
    /// Images of these poses.
    pub images: usize,
    /// Bytes of these images.
    pub bytes: u64,
    /// Whether a process is writing to the folder.
    pub running: bool,
    /// Whether all poses are made and listed in the manifest.
    pub complete: bool,
    /// Number of findings about limbs and poses.
    pub findings: usize,
    /// Number of severe findings that are not acknowledged.
    pub open_findings: usize,
    /// State of each limb.
    pub limbs: Vec<LimbStatus>,
}

/// State of one limb.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LimbStatus {
    /// The limb.
    #[serde(flatten)]
    pub limb: LimbId,
    /// Poses that the folder should hold.
    #[serde(rename = "units")]
    pub pose_jobs: usize,
    /// Finished poses.
    pub made: usize,
}

/// Returns the generation progress of the dataset in `root`; changes nothing and may run while `generate` does.
///
/// # Errors
/// [`FolderError`] when `root` holds no dataset.
pub fn status(root: &Path) -> Result<Status, FolderError> {
    let running = match lock_existing(root) {
        Ok(_) => false,
        Err(FolderError::Busy(_)) => true,
        Err(error) => return Err(error),
    };
    let files = DatasetFiles::open(root)?;
    if files.is_empty_archive() {
        return Err(FolderError::NotADataset(root.to_owned()));
    }
    let part = files.part()?;
    let (mut images, mut bytes) = (0, 0);
    let mut of_limb = |limb: &LimbJobs| {
        let records =
            limb.pose_jobs()
                .filter_map(|pose_job| match files.look(pose_job.id()).ok()? {
                    FoundRecord::Whole(record) if record.key == pose_job.key() => Some(record),
                    _ => None,
                });
        let mut made = 0;
        for record in records {
            // A pose whose images are gone is made again, so it does not count.
            let sizes = record.files.iter().map(|row| files.size(&row.file));
            let Some(size) = sizes.sum::<Option<u64>>() else {
                continue;
            };
            made += 1;
            images += record.files.len();
            bytes += size;
        }
        LimbStatus {
            limb: limb.limb,
            pose_jobs: limb.poses.len(),
            made,
        }
    };
    let limbs: Vec<_> = files
        .planned()?
        .part(part)
        .iter()
        .map(&mut of_limb)
        .collect();
    let pose_jobs = limbs.iter().map(|limb| limb.pose_jobs).sum();
    let made = limbs.iter().map(|limb| limb.made).sum();
    let listed = files.size(Manifest::FILE).is_some();
    let findings = files.findings()?;
    Ok(Status {
        findings: findings.0.len(),
        open_findings: findings.0.iter().filter(|found| found.is_open()).count(),
        part: part.to_string(),
        pose_jobs,
        made,
        images,
        bytes,
        running,
        complete: listed && !running && made == pose_jobs,
        limbs,
    })
}
