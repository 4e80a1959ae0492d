//! Checks and repairs of a damaged dataset.

use std::fs;

use serde_json::Value;

use crate::shards::whole;
use crate::{contents, fail, succeed};

/// A copy of the finished dataset, to be damaged.
fn copy() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in contents(&whole().join("whole")) {
        let path = folder.path().join("plan").join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    fs::copy(whole().join("plan.toml"), folder.path().join("plan.toml")).unwrap();
    folder
}

#[test]
fn a_dataset_is_verified_by_making_a_part_of_it_again() {
    let folder = copy();
    let said = succeed(folder.path(), "verify plan --fraction 0.3 --json");
    let verified: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(verified["units"], 5);
    assert_eq!(verified["images"], 5 * (2 * 2 + 2));
    assert_eq!(verified["remade"], 2);

    let said = fail(folder.path(), "verify plan --fraction 1.5");
    assert!(said.contains("fraction is 1.5"), "{said}");
    fs::rename(folder.path().join("plan"), folder.path().join("moved")).unwrap();
    let said = fail(folder.path(), "verify moved");
    assert!(
        said.contains("moved.toml does not exist; use --plan"),
        "{said}"
    );
    fs::rename(folder.path().join("moved"), folder.path().join("plan")).unwrap();
    let plan = fs::read_to_string(folder.path().join("plan.toml")).unwrap();
    let other = plan.replace("pixel_mm = 25.0", "pixel_mm = 24.0");
    fs::write(folder.path().join("other.toml"), other).unwrap();
    let said = fail(folder.path(), "verify plan --plan other.toml");
    assert!(
        said.contains("settings.xray.detector.pixel_mm differs"),
        "{said}"
    );
}

/// An image that the plan does not make is found even if records and hashes are consistent.
#[test]
fn a_forged_image_is_found_when_its_pose_is_made_again() {
    let folder = copy();
    let root = folder.path().join("plan");
    let [image, another] =
        ["0.0", "2.5"].map(|a| format!("patient_3/depth/r/orig/depth_cam_left_{a}.png"));
    let of = |name: &str| ppa_dataset::sha256_of_file(&root.join(name)).unwrap();
    let (old, new) = (of(&image), of(&another));
    fs::copy(root.join(&another), root.join(&image)).unwrap();
    let replaced = |list: &str, old: &str, new: &str| {
        let text = fs::read_to_string(root.join(list)).unwrap();
        let text = text.replace(old, new);
        fs::write(root.join(list), &text).unwrap();
        text
    };
    // The forger recomputes all hashes.
    let sum = |text: &str| {
        let file = folder.path().join("text");
        fs::write(&file, text).unwrap();
        ppa_dataset::sha256_of_file(&file).unwrap()
    };
    let before = of("manifest.jsonl");
    let manifest = replaced("manifest.jsonl", &old, &new);
    let sums = replaced("checksums.sha256", &before, &sum(&manifest));
    let (lines, own) = sums
        .trim_end()
        .rsplit_once("# sha256 of the lines above: ")
        .unwrap();
    replaced("checksums.sha256", own, &sum(lines));
    let record = replaced(".ppa/patient_3_r_000.json", &old, &new);
    let (head, seal) = record.split_once(",\n\"seal\": \"").unwrap();
    replaced(
        ".ppa/patient_3_r_000.json",
        seal.trim_end_matches("\"}"),
        &sum(head),
    );
    let said = fail(folder.path(), "verify plan --fraction 1 --progress quiet");
    assert!(
        said.contains("depth_cam_left_0.0.png differs when it is generated again"),
        "{said}"
    );
    assert!(!said.contains(';'), "only that one: {said}");
}

#[test]
fn what_was_altered_is_named_and_nothing_is_lost() {
    let folder = copy();
    let root = folder.path().join("plan");
    let before = contents(&root);
    let truncated = root.join("patient_3/depth/r/bumps_a/depth_cam_right_5.0.png");
    let bytes = fs::read(&truncated).unwrap();
    fs::write(&truncated, &bytes[..bytes.len() - 20]).unwrap();
    fs::remove_file(root.join("patient_3/xray/r/xray_image_10.exr")).unwrap();
    let manifest = fs::read_to_string(root.join("manifest.jsonl")).unwrap();
    let edited = manifest.replacen("\"step\":5", "\"step\":6", 1);
    assert_ne!(manifest, edited);
    fs::write(root.join("manifest.jsonl"), edited).unwrap();
    fs::write(root.join("patient_3/labels/r/roi_depth.json"), "{}").unwrap();

    let said = fail(folder.path(), "verify plan --progress quiet");
    for words in [
        "depth_cam_right_5.0.png is altered",
        "xray_image_10.exr cannot be read",
        "manifest.jsonl line 7 is altered: expected the row of patient_3/depth/r/orig/depth_cam_left_2.5.png",
        "roi_depth.json is missing or altered",
    ] {
        assert!(said.contains(words), "{said}");
    }
    let status: Value =
        serde_json::from_str(&succeed(folder.path(), "status plan --json")).unwrap();
    assert_eq!(
        (&status["made"], &status["complete"]),
        (&4.into(), &false.into())
    );

    let said = succeed(folder.path(), "generate plan.toml --json");
    let summary: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(summary["made"], 1, "both damaged images are of one pose");
    let healed = summary["healed"].as_array().unwrap();
    assert_eq!(healed.len(), 4, "two images and two lists: {summary}");
    let kept = |name: &str| fs::read(root.join(".ppa/altered").join(name)).unwrap();
    assert!(kept("patient_3/depth/r/bumps_a/depth_cam_right_5.0.png") == bytes[..bytes.len() - 20]);
    assert!(kept("patient_3/labels/r/roi_depth.json") == b"{}");
    fs::remove_dir_all(root.join(".ppa/altered")).unwrap();
    assert!(contents(&root) == before);
}

/// Until a run has replaced what is missing, no manifest marks the dataset as complete.
#[test]
fn a_broken_run_over_a_finished_dataset_leaves_no_manifest() {
    let folder = copy();
    let root = folder.path().join("plan");
    fs::remove_file(root.join("patient_3/xray/r/xray_image_0.png")).unwrap();
    // A folder in the place of an image cannot be overwritten.
    fs::create_dir(root.join("patient_3/xray/r/xray_image_0.png")).unwrap();
    let said = fail(folder.path(), "generate plan.toml --progress quiet");
    assert!(said.contains("xray_image_0.png"), "{said}");
    assert!(!root.join("manifest.jsonl").exists());
    fs::remove_dir(root.join("patient_3/xray/r/xray_image_0.png")).unwrap();
    succeed(folder.path(), "generate plan.toml");
    assert!(contents(&root) == contents(&whole().join("whole")));
}
