//! Test: the bookkeeping of 20 000 pose jobs.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use ppa_core::Part;
use ppa_dataset::layout::{LimbId, Side};
use ppa_dataset::manifest::RoiFile;
use ppa_scene::Sweep;

use crate::job::{Job, JobError, MakePose, Progress};
use crate::limb_jobs::{LimbJobs, PlannedLimb, jobs_of_part};
use crate::posable_limb::Images;

/// 20 000 poses without images: all are made, and a second run finds every one of them. The times are
/// printed, not tested: each record is synced, so that the disk sets the pace.
#[test]
#[ignore = "writes and syncs 20 000 files; takes half a minute"]
fn twenty_thousand_poses_are_made_and_found_again() {
    let folder = tempfile::tempdir().unwrap();
    let poses = Sweep {
        to_deg: 180.0,
        ..Sweep::default()
    };
    let poses = poses.poses().unwrap();
    let limb = |patient| {
        let side = Side::Left;
        PlannedLimb {
            limb: LimbId { patient, side },
            key: "key".to_owned(),
            acknowledged: Vec::new(),
        }
    };
    let limbs: Vec<_> = (0..56).map(limb).collect();
    let job = |progress| Job {
        root: folder.path(),
        description: "{}",
        part: Part::WHOLE,
        limbs: jobs_of_part(limbs.clone().into_iter(), &poses, Part::WHOLE),
        disk_limit: Some(1),
        replace: false,
        progress,
        one_by_one: false,
        kept: &|_, _| Ok(()),
    };
    let make = |_: &LimbJobs| {
        Ok::<MakePose<JobError>, JobError>(Box::new(|_| {
            Ok(Images {
                files: Vec::new(),
                rois: RoiFile::new(),
                findings: Vec::new(),
            })
        }))
    };
    let begun = Instant::now();
    let made = AtomicUsize::new(0);
    let count = |progress: Progress| {
        if progress == Progress::Made {
            made.fetch_add(1, Ordering::Relaxed);
        }
    };
    let summary = job(&count).complete(make).unwrap();
    eprintln!("made in {:?}", begun.elapsed());
    assert_eq!((summary.pose_jobs, summary.made), (20_216, 20_216));
    assert_eq!(made.load(Ordering::Relaxed), 20_216);

    let begun = Instant::now();
    let summary = job(&|_| {}).complete(make).unwrap();
    eprintln!("found again in {:?}", begun.elapsed());
    assert_eq!((summary.pose_jobs, summary.made), (20_216, 0));
}
