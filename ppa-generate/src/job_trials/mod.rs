//! Tests: jobs with tiny images instead of rendered ones, so that thousands of runs take seconds.

mod archived;
mod copied;
mod flips;
mod interrupted;
#[cfg(unix)]
mod looking;
mod replaced;
mod tasks;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use image::{ImageBuffer, Luma};
use ppa_core::Part;
use ppa_dataset::BodyShape;
use ppa_dataset::archive::is_archive;
use ppa_dataset::files::{FileError, sha256_of_file};
use ppa_dataset::findings::{Finding, FindingCode, Severity};
use ppa_dataset::layout::{LimbId, Side, View};
use ppa_dataset::manifest::{FileKind, FileRow, RoiFile, RoiRow};
use ppa_scene::Sweep;
use sha2::{Digest, Sha256};

use crate::archived_run::ArchivedRun;
use crate::job::{Job, JobError, MakePose, Summary};
use crate::limb_jobs::{LimbJobs, PlannedLimb, jobs_of_part};
use crate::posable_limb::Images;
use crate::pose_id::PoseId;
use crate::record::{PoseJob, Record};
use crate::seal::sealed;
use crate::staging::staging_folder;

/// A plan whose images show its settings.
#[derive(Clone)]
struct Trial {
    kvp: u32,
    to_deg: f64,
    patients: Vec<u32>,
    shapes: Vec<BodyShape>,
    acknowledged: Vec<FindingCode>,
    part: &'static str,
    replace: bool,
    /// The pose that fails, in the order in which poses are made.
    fails_at: Option<usize>,
}

impl Trial {
    /// Two limbs in two poses and two body shapes.
    fn new() -> Self {
        Self {
            kvp: 60,
            to_deg: 0.5,
            patients: vec![0, 7],
            shapes: vec![BodyShape::Orig, BodyShape::Big],
            acknowledged: Vec::new(),
            part: "1/1",
            replace: false,
            fails_at: None,
        }
    }

    fn replacing(&self) -> Self {
        Self {
            replace: true,
            ..self.clone()
        }
    }

    fn sweep(&self) -> Sweep {
        Sweep {
            from_deg: 0.0,
            to_deg: self.to_deg,
            step_deg: 0.5,
        }
    }

    fn planned(&self) -> Vec<PlannedLimb> {
        let limb = |&patient: &u32| PlannedLimb {
            limb: LimbId {
                patient,
                side: Side::Right,
            },
            key: format!("{} {:?} {patient}", self.kvp, self.shapes),
            acknowledged: self.acknowledged.clone(),
        };
        self.patients.iter().map(limb).collect()
    }

    fn limbs(&self) -> Vec<LimbJobs> {
        let poses = self.sweep().poses().unwrap();
        jobs_of_part(
            self.planned().into_iter(),
            &poses,
            self.part.parse().unwrap(),
        )
    }

    fn description(&self) -> String {
        let limb = |limb: PlannedLimb| {
            serde_json::json!({
                "patient": limb.limb.patient, "side": "r", "key": limb.key, "acknowledged": limb.acknowledged,
                "volume_sha256": format!("{:064}", limb.limb.patient),
            })
        };
        let text = serde_json::json!({
            "version": 2, "rotation": self.sweep(), "settings": {"shapes": self.shapes, "xray": {"kvp": self.kvp}},
            "limbs": self.planned().into_iter().map(limb).collect::<Vec<_>>(),
        });
        sealed(&serde_json::to_string_pretty(&text).unwrap())
    }

    fn run(&self, root: &Path) -> Result<Summary, JobError> {
        if is_archive(root) {
            return ArchivedRun::complete(root, |run| {
                let made = self.run_in(run.folder(), &|pose, record| run.add(pose, record));
                made.map_err(|error| error.of_archive(run))
            });
        }
        self.run_in(root, &|_, _| Ok(()))
    }

    fn run_in(
        &self,
        root: &Path,
        kept: &(dyn Fn(PoseId, &Record) -> Result<(), FileError> + Sync),
    ) -> Result<Summary, JobError> {
        let staging = staging_folder(root);
        let count = AtomicUsize::new(0);
        let job = Job {
            root,
            description: &self.description(),
            part: self.part.parse::<Part>().unwrap(),
            limbs: self.limbs(),
            disk_limit: None,
            replace: self.replace,
            progress: &|_| {},
            one_by_one: false,
            kept,
        };
        job.complete(|_| {
            let make = |pose_job: PoseJob| {
                if Some(count.fetch_add(1, Ordering::Relaxed)) == self.fails_at {
                    let failed = FileError::at("make", root)(std::io::Error::other("as asked"));
                    return Err(JobError::from(failed));
                }
                Ok(self.images(&pose_job, &staging))
            };
            Ok(Box::new(make) as MakePose<JobError>)
        })
    }

    /// The files of a fresh run.
    fn fresh(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let folder = self.made();
        contents(folder.path())
    }

    /// A folder with the dataset.
    fn made(&self) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        self.run(folder.path()).unwrap();
        folder
    }

    /// Makes a pose below a folder.
    fn images(&self, pose_job: &PoseJob, to: &Path) -> Images {
        let (limb, step) = (pose_job.limb, pose_job.pose.step);
        let mut files = Vec::new();
        for &shape in &self.shapes {
            for view in View::ALL {
                let file = limb.depth(shape, view, step);
                let row = row(pose_job, file, FileKind::Depth, shape, to);
                files.push(FileRow {
                    camera: Some(view),
                    ..row
                });
            }
        }
        for (file, kind) in [
            (limb.radiograph_png(step), FileKind::Radiograph),
            (limb.radiograph_exr(step), FileKind::RadiographTallies),
        ] {
            files.push(row(pose_job, file, kind, BodyShape::Orig, to));
        }
        let roi = |camera| {
            let row = RoiRow {
                camera,
                image_number: step,
                x_start: 2,
                y_start: 1,
                size: 5,
            };
            (LimbId::depth_name(camera, step), row)
        };
        let finding = Finding {
            code: FindingCode::LimbTooSmall,
            severity: Severity::Severe,
            text: "the limb is 19 ml".to_owned(),
            value: Some(19.0),
            place_mm: None,
        };
        Images {
            files,
            rois: View::ALL.map(roi).into_iter().collect::<RoiFile>(),
            findings: vec![finding],
        }
    }
}

/// Writes an image that depends on key and name, and returns its row.
fn row(pose_job: &PoseJob, file: String, kind: FileKind, shape: BodyShape, to: &Path) -> FileRow {
    let path = to.join(&file);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let noise = Sha256::digest(format!("{} {file}", pose_job.key()));
    if kind == FileKind::RadiographTallies {
        fs::write(&path, noise).unwrap();
    } else {
        let pixel = |x: u32, y: u32| Luma([u16::from(noise[(x + 12 * y) as usize % 32]) + 500]);
        ImageBuffer::from_fn(12, 9, pixel).save(&path).unwrap();
    }
    const POSE: ppa_core::TransformRows = [
        [1.0, 0.0, 0.0, 0.1],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ];
    FileRow {
        sha256: sha256_of_file(&path).unwrap(),
        file,
        kind,
        limb: pose_job.limb,
        step: pose_job.pose.step,
        angle_deg: pose_job.pose.angle_deg,
        camera: None,
        shape,
        volume_change_mm3: None,
        too_far_pixels: 0,
        cut_share: None,
        patient_from_ct: POSE,
        room_from_patient: POSE,
        ct_from_device: None,
        mas: None,
        exposure_index: None,
        seed: None,
    }
}

/// All files below a folder, with their bytes.
fn contents(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(root).unwrap().to_owned();
                files.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    files
}

/// The files that are not set aside.
fn in_place(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = contents(root);
    files.retain(|name, _| !name.starts_with(".ppa/altered"));
    files
}

/// Marsaglia's xorshift.
struct Draw(u64);

impl Draw {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % limit as u64) as usize
    }
}
