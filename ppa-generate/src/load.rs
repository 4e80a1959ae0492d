//! Test: the bookkeeping of 100 000 units.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use ppa_core::Part;
use ppa_dataset::layout::{LimbId, Side};
use ppa_dataset::manifest::RoiFile;
use ppa_scene::Sweep;

use crate::job::{Job, JobError, MakePose, Progress};
use crate::limb_jobs::{LimbJobs, PlannedLimb, jobs_of_part};
use crate::posable_limb::Images;

/// 100 000 poses without images, so that only the bookkeeping takes time: the last tenth is
/// made as fast as the first, and looking them all over again is faster still.
#[test]
#[ignore = "writes 100 000 files; takes a minute"]
fn a_hundred_thousand_units_do_not_slow_down() {
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
    let limbs: Vec<_> = (0..278).map(limb).collect();
    let times = Mutex::new(Vec::new());
    let job = |progress| Job {
        root: folder.path(),
        description: "{}",
        part: Part::WHOLE,
        limbs: jobs_of_part(limbs.clone().into_iter(), &poses, Part::WHOLE),
        disk_limit: Some(1),
        replace: false,
        progress,
    };
    let begun = Instant::now();
    let report = |progress: Progress| {
        if progress == Progress::Made {
            times.lock().unwrap().push(begun.elapsed());
        }
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
    let summary = job(&report).complete(make).unwrap();
    let whole = begun.elapsed();
    assert_eq!((summary.units, summary.made), (100_358, 100_358));
    let times = times.lock().unwrap();
    let tenth = times.len() / 10;
    let first = times[tenth];
    let last = *times.last().unwrap() - times[times.len() - 1 - tenth];
    eprintln!("first tenth {first:?}, last tenth {last:?}, all {whole:?}");
    assert!(
        last < 2 * first + Duration::from_millis(200),
        "{first:?} and {last:?}"
    );

    let begun = Instant::now();
    let summary = job(&|_| {}).complete(make).unwrap();
    eprintln!("looked over in {:?}", begun.elapsed());
    assert_eq!(summary.made, 0);
    assert!(begun.elapsed() < whole);
}
