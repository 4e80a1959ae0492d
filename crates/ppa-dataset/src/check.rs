//! Whether a dataset holds what was made: every image, record and list against the others.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::claim::{Claim, FolderError, claim_existing};
use crate::files::{read_text, sha256_of_file};
use crate::job::LimbUnits;
use crate::manifest::{FileRow, Manifest, RoiFile, roi_text};
use crate::part_file::read_part;
use crate::planned::Planned;
use crate::record::{Record, Unit};

/// Something in a dataset that is not as it was made.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// A pose was never made, or its record is gone or unreadable.
    #[error("{unit} is missing")]
    Missing {
        /// The pose.
        unit: String,
    },
    /// A pose follows from other settings than `dataset.json` tells.
    #[error("{unit} was made from other settings than those in dataset.json")]
    Stale {
        /// The pose.
        unit: String,
    },
    /// An image is not there.
    #[error("{file} cannot be read")]
    Unreadable {
        /// Path from the dataset's root.
        file: String,
    },
    /// An image has other bytes than those that were written.
    #[error("{file} is altered: its hash is not the recorded one")]
    Altered {
        /// Path from the dataset's root.
        file: String,
    },
    /// A pose came out otherwise when it was made again.
    #[error("{file} comes out otherwise when it is made again")]
    Differs {
        /// Path from the dataset's root.
        file: String,
    },
    /// A line of the manifest is not the row of its image.
    #[error("manifest.jsonl line {line} is altered: expected the row of {expected}")]
    ManifestLine {
        /// Counted from 1.
        line: usize,
        /// The image whose row belongs there, or that none does.
        expected: String,
    },
    /// A list cannot be read, or is not what its records tell.
    #[error("{file} is missing or altered")]
    List {
        /// Path from the dataset's root.
        file: String,
    },
}

/// What [`check`] found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Check {
    /// Poses that the folder is to hold.
    pub units: usize,
    /// Images whose bytes were compared with their hash.
    pub images: usize,
    /// Everything that is wrong, in the order of the plan.
    pub problems: Vec<Problem>,
}

/// A dataset that nobody writes to, with the records that can be read.
pub(crate) struct Recorded {
    _claim: Claim,
    pub planned: Planned,
    pub limbs: Vec<LimbUnits>,
    root: PathBuf,
}

impl Recorded {
    pub fn open(root: &Path) -> Result<Self, FolderError> {
        let claim = claim_existing(root)?;
        let planned = Planned::read(root)?;
        Ok(Self {
            _claim: claim,
            limbs: planned.part(read_part(root)?),
            planned,
            root: root.to_owned(),
        })
    }

    /// Compares all files with their records.
    pub fn check(&self) -> Check {
        let units: Vec<_> = self.limbs.iter().flat_map(LimbUnits::units).collect();
        let found: Vec<_> = units.par_iter().map(|unit| self.unit(unit)).collect();
        let mut problems = Vec::new();
        let mut records = Vec::new();
        for (record, of_unit) in found {
            records.extend(record);
            problems.extend(of_unit);
        }
        let images = records.iter().map(|record| record.files.len()).sum();
        // Lists are written after the last pose.
        if records.len() == units.len() {
            problems.extend(self.lists(records));
        }
        Check {
            units: units.len(),
            images,
            problems,
        }
    }

    fn unit(&self, unit: &Unit) -> (Option<Record>, Vec<Problem>) {
        let Ok(record) = Record::read(&self.root, unit) else {
            let unit = unit.to_string();
            return (None, vec![Problem::Missing { unit }]);
        };
        if record.key != unit.key() {
            let unit = unit.to_string();
            return (None, vec![Problem::Stale { unit }]);
        }
        let of_image = |row: &FileRow| {
            let file = row.file.clone();
            match sha256_of_file(&self.root.join(&file)) {
                Err(_) => Some(Problem::Unreadable { file }),
                Ok(found) => (found != row.sha256).then_some(Problem::Altered { file }),
            }
        };
        let problems = record.files.iter().filter_map(of_image).collect();
        (Some(record), problems)
    }

    /// Manifest and regions of interest against the records, which are in the order of the plan.
    fn lists(&self, records: Vec<Record>) -> Vec<Problem> {
        let mut problems = Vec::new();
        let mut files = Vec::new();
        let mut records = records.into_iter();
        for limb in &self.limbs {
            let mut rois = RoiFile::new();
            for record in records.by_ref().take(limb.poses.len()) {
                files.extend(record.files);
                rois.extend(record.rois);
            }
            let file = limb.limb.roi_file();
            if !self.holds(&file, &roi_text(&rois)) {
                problems.push(Problem::List { file });
            }
        }
        let manifest = Manifest {
            root: self.root.clone(),
            files,
        };
        problems.extend(self.manifest(&manifest));
        problems
    }

    fn manifest(&self, expected: &Manifest) -> Option<Problem> {
        let file = Manifest::FILE.to_owned();
        let Ok(found) = read_text(&self.root.join(&file)) else {
            return Some(Problem::List { file });
        };
        let text = expected.to_text();
        if found == text {
            return None;
        }
        let (mut found, mut lines) = (found.lines(), text.lines());
        let same = |_: &usize| matches!((found.next(), lines.next()), (Some(a), Some(b)) if a == b);
        let line = (0..).take_while(same).count();
        let row = expected.files.get(line).map(|row| row.file.clone());
        Some(Problem::ManifestLine {
            line: line + 1,
            expected: row.unwrap_or_else(|| "no further image".to_owned()),
        })
    }

    fn holds(&self, file: &str, text: &str) -> bool {
        read_text(&self.root.join(file)).is_ok_and(|found| found == text)
    }
}

/// Reads every image of the dataset in `root` and compares it with its hash, and manifest and
/// regions of interest with the records they were made from. Changes nothing.
///
/// # Errors
/// [`FolderError`] when `root` holds no dataset or is being written.
pub fn check(root: &Path) -> Result<Check, FolderError> {
    Ok(Recorded::open(root)?.check())
}
