//! A run killed between any two steps of moving a pose into place.

use std::fs;
use std::path::Path;

use ppa_dataset::files::write_whole;

use super::{Trial, contents};
use crate::check::{Problem, check};
use crate::record::Record;
use crate::set_aside::move_file;
use crate::staging::{Staging, staging_folder};

/// Leaves the folder as a run that is killed after the first `moved` images of the pose at 0.5 degrees are in their place.
fn kill_after(root: &Path, trial: &Trial, moved: usize) {
    let limbs = trial.limbs();
    let pose_job = limbs[0].pose_job(limbs[0].poses[1]);
    let staging = staging_folder(root);
    let images = trial.images(&pose_job, &staging);
    let record = Record {
        key: pose_job.key(),
        files: images.files,
        rois: images.rois,
        findings: images.findings,
    };
    write_whole(
        &staging.join(pose_job.id().record_name()),
        record.to_text().as_bytes(),
    )
    .unwrap();
    for row in &record.files[..moved] {
        move_file(&staging.join(&row.file), &root.join(&row.file)).unwrap();
    }
}

#[test]
fn a_pose_that_was_half_replaced_is_completed() {
    let other = Trial {
        kvp: 70,
        ..Trial::new()
    };
    for moved in 0..=6 {
        let folder = Trial::new().made();
        let root = folder.path();
        kill_after(root, &other, moved);
        let limbs = other.limbs();
        let pose_job = limbs[0].pose_job(limbs[0].poses[1]);
        let interrupted = Problem::Interrupted {
            pose_job: pose_job.to_string(),
        };
        assert!(check(root).unwrap().problems.contains(&interrupted));
        Staging::new(root).recover().unwrap();
        assert!(!staging_folder(root).exists());
        let record = Record::read(root, &pose_job).unwrap();
        assert_eq!(record.key, pose_job.key(), "{moved}");
        assert!(record.damaged_images(root).is_empty(), "{moved}");
        other.replacing().run(root).unwrap();
        assert!(contents(root) == other.fresh(), "{moved}");
    }
}

#[test]
fn a_first_run_that_was_killed_resumes() {
    let first = Trial {
        to_deg: 0.0,
        ..Trial::new()
    };
    for (moved, lost) in [(0, None), (3, None), (6, None), (3, Some(1)), (3, Some(5))] {
        let folder = first.made();
        let root = folder.path();
        kill_after(root, &Trial::new(), moved);
        // A file is lost in addition.
        if let Some(lost) = lost {
            let images = Trial::new().limbs()[0]
                .pose_jobs()
                .nth(1)
                .unwrap()
                .id()
                .images();
            let existing = |file: &&String| {
                root.join(file).exists() || staging_folder(root).join(file).exists()
            };
            let file = images.iter().filter(existing).nth(lost).unwrap();
            let _ = fs::remove_file(root.join(file));
            let _ = fs::remove_file(staging_folder(root).join(file));
        }
        let summary = Trial::new().run(root).unwrap();
        assert_eq!(summary.set_aside.len(), 0, "{moved} {lost:?}");
        assert!(contents(root) == Trial::new().fresh(), "{moved} {lost:?}");
    }
}
