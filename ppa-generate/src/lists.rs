//! Lists over all poses: regions of interest, findings and manifest, with their hashes.

use std::path::{Path, PathBuf};

use ppa_dataset::checksums::Checksums;
use ppa_dataset::files::read_text;
use ppa_dataset::findings::Findings;
use ppa_dataset::manifest::DESCRIPTION_FILE;
use ppa_dataset::manifest::{FileRow, Manifest, RoiFile, roi_text};

use crate::limb_jobs::LimbJobs;
use crate::record::{PoseJob, Record};

/// The lists that follow from a dataset's records.
pub(crate) struct Lists {
    /// Path from the root and text of each, in the order in which they are written: hashes first, the manifest last, since it marks a
    /// complete dataset.
    pub files: Vec<(String, String)>,
    /// The rows of the manifest.
    pub rows: Vec<FileRow>,
    /// The findings of all limbs and poses.
    pub findings: Findings,
}

impl Lists {
    /// Builds the lists of a dataset with the given `dataset.json` from the records of its poses in the order of the plan.
    pub fn of<E>(
        limbs: &[LimbJobs],
        description: &str,
        mut record: impl FnMut(&PoseJob) -> Result<Record, E>,
    ) -> Result<Self, E> {
        let mut files = vec![(Checksums::FILE.to_owned(), String::new())];
        let mut manifest = Manifest {
            root: PathBuf::new(),
            files: Vec::new(),
        };
        let mut findings = Findings::default();
        for limb in limbs {
            let mut rois = RoiFile::new();
            for pose_job in limb.pose_jobs() {
                let record = record(&pose_job)?;
                manifest.files.extend(record.files);
                rois.extend(record.rois);
                findings.add(limb.limb, &limb.acknowledged, &record.findings);
            }
            files.push((limb.limb.roi_file(), roi_text(&rois)));
        }
        if !findings.0.is_empty() {
            files.push((Findings::FILE.to_owned(), findings.to_text()));
        }
        files.push((Manifest::FILE.to_owned(), manifest.to_text()));
        let lists = files[1..]
            .iter()
            .map(|(file, text)| (file.as_str(), text.as_str()));
        let covered = lists.chain([(DESCRIPTION_FILE, description)]);
        files[0].1 = Checksums::of(covered).to_text();
        Ok(Self {
            files,
            rows: manifest.files,
            findings,
        })
    }

    /// Whether a file is one of the lists.
    pub fn holds(&self, file: &str) -> bool {
        self.files.iter().any(|(list, _)| list == file)
    }
}

/// Whether a list in a dataset has the given text.
pub(crate) fn stands(root: &Path, (file, text): &(String, String)) -> bool {
    read_text(&root.join(file)).is_ok_and(|found| found == *text)
}
