//! Datasets of other plans in the folder of a run.

use std::fs;
use std::path::Path;

use ppa_dataset::BodyShape;
use ppa_dataset::findings::{FindingCode, Findings};

use super::{Trial, contents, in_place};
use crate::check::{Problem, check};
use crate::dataset_lock::{FolderError, lock};
use crate::job::JobError;
use crate::record::{FoundRecord, Record};
use crate::status::status;

fn other() -> Trial {
    Trial {
        kvp: 70,
        shapes: vec![BodyShape::Orig],
        ..Trial::new()
    }
}

fn refused(trial: &Trial, root: &Path) -> String {
    let before = contents(root);
    let said = trial.run(root).unwrap_err().to_string();
    assert!(contents(root) == before, "{said}");
    said
}

#[test]
fn other_settings_are_refused_with_the_keys_that_differ() {
    let folder = Trial::new().made();
    let said = refused(&other(), folder.path());
    for words in [
        "4 of its 4 poses were made from other inputs",
        "settings.xray.kvp is 60 in the dataset and 70 in this run",
        "settings.shapes is [\"orig\",\"big\"] in the dataset and [\"orig\"] in this run",
        "--replace",
        "--out",
    ] {
        assert!(said.contains(words), "{said}");
    }
}

#[test]
fn a_replaced_dataset_is_that_of_a_fresh_run() {
    let folder = Trial::new().made();
    let summary = other().replacing().run(folder.path()).unwrap();
    assert_eq!((summary.made, summary.replaced, summary.removed), (4, 4, 0));
    assert_eq!((summary.healed.len(), summary.set_aside.len()), (0, 0));
    assert!(contents(folder.path()) == other().fresh());
    assert!(!folder.path().join("patient_0/depth/r/big").exists());
}

/// Whether the record of each pose is there and its images are those that it lists; the number with the given key.
fn whole_poses(root: &Path, trial: &Trial) -> usize {
    let limbs = trial.limbs();
    let mut of_trial = 0;
    for pose_job in limbs.iter().flat_map(|limb| limb.pose_jobs()) {
        let path = root.join(pose_job.id().record_file());
        let FoundRecord::Whole(record) = Record::look(&path, pose_job.id()).unwrap() else {
            panic!("{pose_job} has no record");
        };
        assert!(record.damaged_images(root).is_empty(), "{pose_job}");
        let images = pose_job.id().images();
        let there = images
            .iter()
            .filter(|file| root.join(file).exists())
            .count();
        assert_eq!(there, record.files.len(), "{pose_job}");
        of_trial += usize::from(record.key == pose_job.key());
    }
    of_trial
}

#[test]
fn a_broken_replacement_leaves_each_pose_whole() {
    for fails_at in 0..4 {
        let folder = Trial::new().made();
        let root = folder.path();
        let before = contents(root);
        let broken = Trial {
            fails_at: Some(fails_at),
            ..other().replacing()
        };
        let error = broken.run(root).unwrap_err();
        assert!(error.to_string().contains("make"), "{error}");
        let replaced = whole_poses(root, &other());
        assert!(replaced <= 3);
        if replaced == 0 {
            let mut after = contents(root);
            after.retain(|name, _| !name.starts_with(".ppa/new"));
            assert!(after == before, "the first pose was not finished");
        } else {
            assert!(!root.join("manifest.jsonl").exists());
            let now = status(root).unwrap();
            assert_eq!((now.made, now.complete), (replaced, false));
            // Neither plan replaces poses unasked.
            assert!(
                other()
                    .run(root)
                    .unwrap_err()
                    .to_string()
                    .contains("was interrupted")
            );
            Trial::new().run(root).unwrap_err();
        }
        other().replacing().run(root).unwrap();
        assert!(contents(root) == other().fresh());
    }
}

#[test]
fn a_plan_that_shrinks_removes_poses_only_when_asked_to() {
    let wide = Trial::new();
    let narrow = Trial {
        to_deg: 0.0,
        patients: vec![0],
        ..Trial::new()
    };
    let folder = wide.made();
    let root = folder.path();
    let said = refused(&narrow, root);
    assert!(
        said.contains(
            "3 poses of it, the first limb r of patient 0 at 0.5 degrees, are not in this run"
        ),
        "{said}"
    );
    // Files written by readers stay.
    let labels = root.join("patient_7/labels/r/labels.json");
    fs::write(&labels, "{}").unwrap();
    let summary = narrow.replacing().run(root).unwrap();
    assert_eq!((summary.made, summary.removed), (0, 3));
    assert_eq!(fs::read_to_string(&labels).unwrap(), "{}");
    fs::remove_dir_all(root.join("patient_7")).unwrap();
    assert!(contents(root) == narrow.fresh());
}

#[test]
fn a_plan_that_grows_resumes() {
    let narrow = Trial {
        to_deg: 0.0,
        patients: vec![7],
        ..Trial::new()
    };
    let folder = narrow.made();
    let summary = Trial::new().run(folder.path()).unwrap();
    assert_eq!((summary.pose_jobs, summary.made), (4, 3));
    assert!(contents(folder.path()) == Trial::new().fresh());
}

#[test]
fn acknowledged_findings_concern_no_pose() {
    let folder = Trial::new().made();
    let root = folder.path();
    assert!(Findings::read(root).unwrap().0[0].is_open());
    let acknowledging = Trial {
        acknowledged: vec![FindingCode::LimbTooSmall],
        ..Trial::new()
    };
    let summary = acknowledging.run(root).unwrap();
    assert_eq!(
        (summary.made, summary.healed.len(), summary.set_aside.len()),
        (0, 0, 0)
    );
    assert!(contents(root) == acknowledging.fresh());
    assert!(!Findings::read(root).unwrap().0[0].is_open());
}

#[test]
fn two_runs_do_not_share_a_folder() {
    let folder = Trial::new().made();
    let lock = lock(folder.path()).unwrap();
    let said = refused(&other().replacing(), folder.path());
    assert!(said.contains("in use by another process"), "{said}");
    assert!(matches!(check(folder.path()), Err(FolderError::Busy(_))));
    assert!(status(folder.path()).unwrap().running);
    drop(lock);
    assert!(!status(folder.path()).unwrap().running);
}

#[test]
fn another_part_is_refused_even_when_replacing() {
    let of = |part| Trial {
        part,
        ..Trial::new()
    };
    for (held, asked, words) in [
        (
            "2/2",
            "1/1",
            ["holds shard 2/2", "make the whole plan; --shard 2/2"],
        ),
        ("2/2", "1/2", ["holds shard 2/2", "make shard 1/2"]),
        (
            "1/1",
            "2/2",
            ["holds the whole plan", "a run without --shard"],
        ),
    ] {
        let folder = of(held).made();
        let said = refused(&of(asked).replacing(), folder.path());
        assert!(words.iter().all(|word| said.contains(word)), "{said}");
        assert_eq!(of(held).run(folder.path()).unwrap().made, 0);
    }
}

/// Foreign files at paths of images are kept.
#[test]
fn files_of_others_are_never_overwritten() {
    let folder = Trial::new().made();
    let root = folder.path();
    let [edited, hidden] = [
        "patient_0/xray/r/xray_image_1.png",
        "patient_0/xray/r/.notes",
    ];
    fs::write(root.join(edited), "painted over").unwrap();
    fs::write(root.join(hidden), "mine").unwrap();
    assert_eq!(
        check(root).unwrap().problems,
        [Problem::Altered {
            file: edited.to_owned()
        }]
    );
    let summary = other().replacing().run(root).unwrap();
    assert_eq!(summary.set_aside, [format!(".ppa/altered/{edited}")]);
    assert_eq!(
        fs::read_to_string(root.join(&summary.set_aside[0])).unwrap(),
        "painted over"
    );
    assert_eq!(fs::read_to_string(root.join(hidden)).unwrap(), "mine");
    fs::remove_file(root.join(hidden)).unwrap();
    assert!(in_place(root) == other().fresh());

    // A second one gets its own name.
    fs::write(root.join(edited), "again").unwrap();
    let summary = other().run(root).unwrap();
    assert_eq!(summary.set_aside, [format!(".ppa/altered/{edited}.1")]);
    assert_eq!(summary.healed, [edited]);
}

#[test]
fn a_folder_in_the_place_of_an_image_stops_the_run() {
    let folder = Trial::new().made();
    let image = folder.path().join("patient_0/xray/r/xray_image_1.png");
    fs::remove_file(&image).unwrap();
    fs::create_dir(&image).unwrap();
    let error = Trial::new().run(folder.path()).unwrap_err();
    assert!(
        matches!(&error, JobError::File(error) if error.path == image),
        "{error}"
    );
}
