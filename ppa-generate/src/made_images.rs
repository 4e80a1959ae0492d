//! The images of a dataset that have been made so far, while others are missing.

use std::path::Path;

use ppa_dataset::layout::LimbId;
use ppa_dataset::manifest::{FileRow, RoiFile};

use crate::dataset_lock::FolderError;
use crate::part_file::read_part;
use crate::planned::Planned;
use crate::record::Record;

/// Images of one limb with their regions of interest.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MadeImages {
    /// A row for each image, in the order of the plan.
    pub files: Vec<FileRow>,
    /// Regions of interest of the depth images.
    pub rois: RoiFile,
}

/// Returns the images of a limb made so far in the dataset `root`, from the records of its poses; may run while `generate` does.
///
/// # Errors
/// [`FolderError`] when `root` holds no dataset.
pub fn made_images(root: &Path, limb: LimbId) -> Result<MadeImages, FolderError> {
    let jobs = Planned::read(root)?.part(read_part(root)?);
    let mut made = MadeImages::default();
    for jobs in jobs.iter().filter(|jobs| jobs.limb == limb) {
        for pose_job in jobs.pose_jobs() {
            // A pose without a record, or with a record of other settings, is made later.
            let Ok(record) = Record::read(root, &pose_job) else {
                continue;
            };
            if record.key == pose_job.key() {
                made.files.extend(record.files);
                made.rois.extend(record.rois);
            }
        }
    }
    Ok(made)
}
