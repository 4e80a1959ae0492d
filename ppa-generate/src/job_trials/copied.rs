//! Datasets that were copied in part.

use std::fs;

use super::{Trial, contents, in_place};
use crate::dataset_lock::FolderError;
use crate::job::JobError;

#[test]
fn images_without_the_folder_of_records_are_refused() {
    let folder = Trial::new().made();
    let root = folder.path();
    fs::remove_dir_all(root.join(".ppa")).unwrap();
    let before = contents(root);
    for trial in [Trial::new(), Trial::new().replacing()] {
        let error = trial.run(root).unwrap_err();
        let JobError::Folder(FolderError::WithoutRecords { found, .. }) = &error else {
            panic!("{error}");
        };
        assert_eq!(found, "checksums.sha256");
        assert!(contents(root) == before);
    }
}

#[test]
fn images_without_records_are_replaced_on_request_only() {
    let folder = Trial::new().made();
    let root = folder.path();
    fs::remove_file(root.join(".ppa/patient_7_r_001.json")).unwrap();
    let before = contents(root);
    let said = Trial::new().run(root).unwrap_err().to_string();
    let words = "6 images, the first patient_7/depth/r/orig/depth_cam_left_0.5.png, are not in any of its records";
    assert!(said.contains(words), "{said}");
    assert!(contents(root) == before);
    let summary = Trial::new().replacing().run(root).unwrap();
    assert_eq!(
        (summary.made, summary.set_aside.len()),
        (1, 0),
        "they are as they would be made"
    );
    assert!(contents(root) == Trial::new().fresh());
}

#[test]
fn records_without_images_or_description_are_completed() {
    let folder = Trial::new().made();
    let root = folder.path();
    for file in [
        "dataset.json",
        "manifest.jsonl",
        "checksums.sha256",
        "findings.json",
        "patient_0/labels/r/roi_depth.json",
    ] {
        fs::remove_file(root.join(file)).unwrap();
        let summary = Trial::new().run(root).unwrap();
        assert_eq!((summary.made, summary.set_aside.len()), (0, 0), "{file}");
        assert!(contents(root) == Trial::new().fresh(), "{file}");
    }
    fs::remove_dir_all(root.join("patient_7/depth")).unwrap();
    let summary = Trial::new().run(root).unwrap();
    assert_eq!((summary.made, summary.healed.len()), (2, 8));
    assert!(in_place(root) == Trial::new().fresh());
}
