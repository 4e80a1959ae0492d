//! Shards made by many tasks of a cluster, some of which fail or are preempted, and their merge.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use ppa_core::Part;
use ppa_dataset::BodyShape;
use ppa_dataset::files::FileError;

use super::{Draw, Trial, contents};
use crate::archived_run::ArchivedRun;
use crate::job::{Job, JobError, MakePose, Summary};
use crate::merge::merge;
use crate::pose_id::PoseId;
use crate::record::{PoseJob, Record};
use crate::staging::staging_folder;

/// A plan of limbs in fifty poses each, divided into tasks of one shard.
struct Tasks {
    plan: Trial,
    root: tempfile::TempDir,
    count: usize,
    /// File name ending of shards: `.tar`, or nothing for folders.
    ending: &'static str,
    /// Number of times each pose was made.
    made: Mutex<BTreeMap<String, usize>>,
}

impl Tasks {
    fn new(limbs: u32, count: usize, ending: &'static str) -> Self {
        let plan = Trial {
            to_deg: 24.5,
            patients: (0..limbs).collect(),
            shapes: vec![BodyShape::Orig],
            ..Trial::new()
        };
        Self {
            plan,
            root: tempfile::tempdir().unwrap(),
            count,
            ending,
            made: Mutex::default(),
        }
    }

    fn shard(&self, task: usize) -> PathBuf {
        self.root.path().join(format!("{task}{}", self.ending))
    }

    /// Runs a task until it has made `most` poses; returns whether it completed.
    fn run(&self, task: usize, most: usize) -> bool {
        let part: Part = format!("{}/{}", task + 1, self.count).parse().unwrap();
        let part_text: &'static str = part.to_string().leak();
        let trial = Trial {
            part: part_text,
            ..self.plan.clone()
        };
        let shard = self.shard(task);
        let ended = match self.ending {
            "" => self.run_in(&trial, &shard, most, &|_, _| Ok(())),
            _ => ArchivedRun::complete(&shard, |run| {
                self.run_in(&trial, run.folder(), most, &|pose, record| {
                    run.add(pose, record)
                })
            }),
        };
        ended.is_ok()
    }

    fn run_in(
        &self,
        trial: &Trial,
        root: &Path,
        most: usize,
        kept: &(dyn Fn(PoseId, &Record) -> Result<(), FileError> + Sync),
    ) -> Result<Summary, JobError> {
        let staging = staging_folder(root);
        let begun = Mutex::new(0);
        let job = Job {
            root,
            description: &trial.description(),
            part: trial.part.parse().unwrap(),
            limbs: trial.limbs(),
            disk_limit: None,
            replace: false,
            progress: &|_| {},
            one_by_one: false,
            kept,
        };
        job.complete(|_| {
            let make = |pose_job: PoseJob| {
                let mut begun = begun.lock().unwrap();
                if *begun == most {
                    let stopped = FileError::at("make", root)(std::io::Error::other("preempted"));
                    return Err(JobError::from(stopped));
                }
                *begun += 1;
                let mut made = self.made.lock().unwrap();
                *made.entry(pose_job.to_string()).or_default() += 1;
                Ok(trial.images(&pose_job, &staging))
            };
            Ok(Box::new(make) as MakePose<JobError>)
        })
    }

    /// There may be more shards than a process may have files open.
    fn open_few_files(&self) {
        let Ok(open) = std::fs::read_dir("/proc/self/fd") else {
            return;
        };
        let files = open
            .flatten()
            .filter_map(|file| file.path().read_link().ok());
        let of_shards = files
            .filter(|file| file.starts_with(self.root.path()))
            .count();
        assert!(of_shards <= 20, "{of_shards} files of shards are open");
    }

    fn merge(&self, into: &Path) {
        let shards: Vec<_> = (0..self.count).map(|task| self.shard(task)).collect();
        let stop = AtomicBool::new(false);
        let begun = Instant::now();
        let summary = merge(&shards, into, false, &stop, &|_| self.open_few_files()).unwrap();
        eprintln!(
            "{} poses of {} shards merged in {:?}",
            summary.made,
            self.count,
            begun.elapsed()
        );
    }
}

#[test]
fn tasks_that_fail_lose_and_repeat_no_pose() {
    for ending in ["", ".tar"] {
        let tasks = Tasks::new(8, 80, ending);
        let mut draw = Draw(0x9e37_79b9_7f4a_7c15);
        let mut missing: Vec<usize> = (0..tasks.count).collect();
        let mut stopped = 0;
        while !missing.is_empty() {
            missing.retain(|&task| {
                // One task in five is stopped, before its first pose or later. It may have been at its end then.
                let most = match draw.below(5) {
                    0 => draw.below(5),
                    _ => usize::MAX,
                };
                let ended = tasks.run(task, most);
                stopped += usize::from(!ended);
                !ended
            });
        }
        assert!(stopped > 5, "{stopped}");
        let made = tasks.made.lock().unwrap();
        assert_eq!(made.len(), 400);
        assert!(made.values().all(|&times| times == 1), "{made:?}");
        let merged = tempfile::tempdir().unwrap();
        tasks.merge(merged.path());
        assert!(contents(merged.path()) == tasks.plan.fresh());
    }
}

/// The times are printed, not tested: each record is synced, so that the disk sets the pace.
#[test]
#[ignore = "writes and syncs 4000 records; takes twenty seconds"]
fn a_thousand_poses_of_a_hundred_shards_are_merged() {
    for ending in ["", ".tar"] {
        let tasks = Tasks::new(20, 100, ending);
        for task in 0..tasks.count {
            assert!(tasks.run(task, usize::MAX));
        }
        let merged = tempfile::tempdir().unwrap();
        tasks.merge(&merged.path().join(format!("merged{ending}")));
    }
}
