//! The units of a dataset carried through: what is there is kept, what is missing is made.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use ppa_scene::PoseAngle;
use ppa_xray::Part;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::body_shape::BodyShape;
use crate::claim::{FolderError, claim};
use crate::description::DESCRIPTION_FILE;
use crate::files::{FileError, remove_if_there, write_whole};
use crate::findings::{FindingCode, Findings};
use crate::layout::{LimbId, View};
use crate::manifest::{FileKind, Manifest, RoiFile, roi_text};
use crate::part_file::write_part;
use crate::record::{Record, Unit};
use crate::unit::Images;

/// What a run did.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// Poses of the plan, or of the shard.
    pub units: usize,
    /// Poses that were made in this run; the others were there already.
    pub made: usize,
    /// Depth images in the folder.
    pub depth_images: usize,
    /// Radiographs in the folder.
    pub radiographs: usize,
}

/// What a run reports while it goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// The number of poses, first of all.
    Total(usize),
    /// Another pose was found complete.
    Found,
    /// Another pose was made.
    Made,
}

/// Why a run ended before its last pose. What was finished stays and is not made again.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JobError {
    /// The folder.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
    /// The images would take more disk than they may.
    #[error(
        "the images in {} would take more than {limit} bytes, of which {used} are used; raise the disk limit and run \
         again to go on",
        root.display()
    )]
    DiskLimit {
        /// The dataset's folder.
        root: PathBuf,
        /// What they may take, bytes.
        limit: u64,
        /// What the finished ones take, bytes.
        used: u64,
    },
}

/// A limb of a dataset, as `dataset.json` lists it.
#[derive(Debug, Clone, Deserialize)]
pub(crate) struct PlannedLimb {
    #[serde(flatten)]
    pub limb: LimbId,
    pub key: String,
    #[serde(default)]
    pub acknowledged: Vec<FindingCode>,
}

/// All poses of one limb that belong to a job.
pub(crate) struct LimbUnits {
    pub limb: LimbId,
    pub key: String,
    /// Codes of the findings that its case acknowledges.
    pub acknowledged: Vec<FindingCode>,
    pub poses: Vec<PoseAngle>,
}

impl LimbUnits {
    pub fn unit(&self, pose: PoseAngle) -> Unit<'_> {
        Unit {
            limb: self.limb,
            pose,
            limb_key: &self.key,
        }
    }

    pub fn units(&self) -> impl Iterator<Item = Unit<'_>> {
        self.poses.iter().map(|&pose| self.unit(pose))
    }
}

/// The units of one part of a dataset. Parts are runs of neighbours, limb by limb, so that few
/// of them prepare the same limb.
pub(crate) fn units_of_part(
    limbs: impl ExactSizeIterator<Item = PlannedLimb>,
    poses: &[PoseAngle],
    part: Part,
) -> Vec<LimbUnits> {
    let share = part.share((limbs.len() * poses.len()) as u64);
    let within = |index: usize| share.contains(&(index as u64));
    let of_limb = |(i, limb): (usize, PlannedLimb)| {
        let planned = poses.iter().enumerate();
        let mine = planned.filter(|(j, _)| within(i * poses.len() + j));
        LimbUnits {
            limb: limb.limb,
            key: limb.key,
            acknowledged: limb.acknowledged,
            poses: mine.map(|(_, pose)| *pose).collect(),
        }
    };
    let limbs = limbs.enumerate().map(of_limb);
    limbs.filter(|limb| !limb.poses.is_empty()).collect()
}

/// Makes one pose of a limb: its files whole, in the dataset's folder.
pub(crate) type MakeUnit<'a, E> = Box<dyn Fn(Unit) -> Result<Images, E> + Sync + 'a>;

/// Units, the folder they belong to, and how much of it they may fill.
pub(crate) struct Job<'a> {
    pub root: &'a Path,
    /// `dataset.json`, the same for all parts.
    pub description: &'a str,
    pub part: Part,
    pub limbs: Vec<LimbUnits>,
    pub disk_limit: Option<u64>,
    pub progress: &'a (dyn Fn(Progress) + Sync),
}

impl Job<'_> {
    /// Makes what is missing, several units at a time; `prepare` is called once per limb.
    pub fn complete<'m, E: From<JobError> + Send>(
        &self,
        prepare: impl Fn(&LimbUnits) -> Result<MakeUnit<'m, E>, E>,
    ) -> Result<Summary, E> {
        let units = || self.limbs.iter().flat_map(LimbUnits::units);
        let names: HashSet<_> = units().map(|unit| unit.record_name()).collect();
        let _claim = claim(self.root, &names).map_err(JobError::from)?;
        self.begin().map_err(JobError::from)?;
        (self.progress)(Progress::Total(names.len()));

        let used = AtomicU64::new(0);
        let mut made = 0;
        for limb in &self.limbs {
            let missing = self.missing(limb, &used).map_err(JobError::from)?;
            if missing.is_empty() {
                continue;
            }
            self.make_room(limb, &missing).map_err(JobError::from)?;
            let make = prepare(limb)?;
            missing
                .par_iter()
                .try_for_each(|&pose| self.make(&limb.unit(pose), &make, &used))?;
            made += missing.len();
        }
        Ok(self.finish(made).map_err(JobError::from)?)
    }

    /// Leaves in the folder what it is to hold, so that its state can be told from then on.
    fn begin(&self) -> Result<(), FileError> {
        write_part(self.root, self.part)?;
        let path = self.root.join(DESCRIPTION_FILE);
        write_whole(&path, self.description.as_bytes())
    }

    /// The poses that are not complete; adds the bytes of the others to `used`.
    fn missing(&self, limb: &LimbUnits, used: &AtomicU64) -> Result<Vec<PoseAngle>, FileError> {
        let lacks = |&pose: &PoseAngle| match Record::of_complete(self.root, &limb.unit(pose)) {
            None => Ok(Some(pose)),
            Some(record) => {
                used.fetch_add(record.size(self.root)?, Ordering::Relaxed);
                (self.progress)(Progress::Found);
                Ok(None)
            }
        };
        let poses = limb.poses.par_iter();
        poses.filter_map(|pose| lacks(pose).transpose()).collect()
    }

    /// Removes what stands in the place of poses that are to be made: the manifest, which would
    /// list images that are gone, and the images that an earlier plan, code or kill left, of which
    /// this plan may make fewer.
    fn make_room(&self, limb: &LimbUnits, missing: &[PoseAngle]) -> Result<(), FileError> {
        remove_if_there(&self.root.join(Manifest::FILE))?;
        remove_if_there(&self.root.join(limb.limb.roi_file()))?;
        for &pose in missing {
            for shape in BodyShape::ALL {
                for view in View::ALL {
                    remove_if_there(&self.root.join(limb.limb.depth(shape, view, pose.step)))?;
                }
            }
            remove_if_there(&self.root.join(limb.limb.radiograph_png(pose.step)))?;
            remove_if_there(&self.root.join(limb.limb.radiograph_exr(pose.step)))?;
        }
        Ok(())
    }

    fn make<E: From<JobError>>(
        &self,
        unit: &Unit,
        make: &MakeUnit<E>,
        used: &AtomicU64,
    ) -> Result<(), E> {
        let Images {
            files,
            rois,
            findings,
        } = make(*unit)?;
        let record = Record {
            key: unit.key(),
            files,
            rois,
            findings,
        };
        self.keep(unit, &record, used)?;
        (self.progress)(Progress::Made);
        Ok(())
    }

    /// Writes the record of a unit, or removes its images where they are too many bytes.
    fn keep(&self, unit: &Unit, record: &Record, used: &AtomicU64) -> Result<(), JobError> {
        let size = record.size(self.root)?;
        let before = used.fetch_add(size, Ordering::Relaxed);
        if let Some(limit) = self.disk_limit
            && before + size > limit
        {
            used.fetch_sub(size, Ordering::Relaxed);
            for row in &record.files {
                remove_if_there(&self.root.join(&row.file))?;
            }
            return Err(JobError::DiskLimit {
                root: self.root.to_owned(),
                limit,
                used: before,
            });
        }
        Ok(record.write(self.root, unit)?)
    }

    /// Writes what lists all units: regions of interest, findings and manifest.
    fn finish(&self, made: usize) -> Result<Summary, FileError> {
        let mut manifest = Manifest {
            root: self.root.to_owned(),
            files: Vec::new(),
        };
        let mut findings = Findings::default();
        for limb in &self.limbs {
            let mut rois = RoiFile::new();
            for unit in limb.units() {
                let record = Record::read(self.root, &unit)?;
                manifest.files.extend(record.files);
                rois.extend(record.rois);
                findings.add(limb.limb, &limb.acknowledged, &record.findings);
            }
            write_whole(
                &self.root.join(limb.limb.roi_file()),
                roi_text(&rois).as_bytes(),
            )?;
        }
        let path = self.root.join(Findings::FILE);
        if findings.0.is_empty() {
            remove_if_there(&path)?;
        } else {
            write_whole(&path, findings.to_text().as_bytes())?;
        }
        manifest.write()?;
        let count = |kind| manifest.files.iter().filter(|row| row.kind == kind).count();
        Ok(Summary {
            units: self.limbs.iter().map(|limb| limb.poses.len()).sum(),
            made,
            depth_images: count(FileKind::Depth),
            radiographs: count(FileKind::Radiograph),
        })
    }
}
