//! Datasets checked, split and converted as a user does it.

use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use serde_json::Value;

use crate::{contents, fail, names, succeed, write_plan};

/// A dataset of one limb and five poses in the folder `data`.
fn dataset() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        write_plan(folder.path(), "[shapes]\nvariants = [\"orig\", \"big\"]\n");
        succeed(folder.path(), "generate plan.toml --out data");
        folder
    });
    folder.path()
}

/// A copy of it that may be changed.
fn copy() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in contents(&dataset().join("data")) {
        let path = folder.path().join("data").join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    folder
}

#[test]
fn a_dataset_is_checked_and_converted_there_and_back() {
    let folder = copy();
    let said = succeed(folder.path(), "dataset check data --json");
    let told: Value = serde_json::from_str(&said).unwrap();
    let count = |key: &str| told[key].as_u64().unwrap();
    assert_eq!(
        (count("patients"), count("pairs"), count("depth_images")),
        (1, 10, 20)
    );
    assert_eq!(
        (count("regions"), count("radiographs"), count("labelled")),
        (20, 5, 0)
    );
    assert_eq!(told["manifest"], true);
    succeed(
        folder.path(),
        "dataset convert data --out specimen --flexion max",
    );
    let said = succeed(
        folder.path(),
        "dataset convert specimen --out back --flexion max --json",
    );
    let told: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(
        (told["depth_images"].as_u64(), told["left_out"].as_u64()),
        (Some(20), Some(0))
    );
    let mut original = contents(&folder.path().join("data"));
    original.retain(|name, _| {
        let tallies = name.extension().is_some_and(|extension| extension == "exr");
        name.starts_with("patient_3") && !tallies
    });
    assert!(contents(&folder.path().join("back")) == original);
    let said = fail(folder.path(), "dataset convert data --out back");
    assert!(said.contains("not an empty folder"), "{said}");
}

#[test]
fn what_was_edited_by_hand_is_told() {
    let folder = copy();
    let data = folder.path().join("data");
    let image = "patient_3/depth/r/big/depth_cam_left_5.0.png";
    let manifest = fs::read_to_string(data.join("manifest.jsonl")).unwrap();
    let whole = fs::read(data.join(image)).unwrap();
    let said_after = |edit: &dyn Fn()| {
        edit();
        let said = fail(folder.path(), "dataset check data");
        fs::write(data.join("manifest.jsonl"), &manifest).unwrap();
        fs::write(data.join(image), &whole).unwrap();
        said
    };
    let edited = |from: &str, to: &str| {
        assert!(manifest.contains(from));
        fs::write(data.join("manifest.jsonl"), manifest.replacen(from, to, 1)).unwrap();
    };
    let other = data.join("patient_3/depth/r/orig/depth_cam_left_5.0.png");
    let first_row = manifest.lines().next().unwrap().to_owned() + "\n";
    for (edit, parts) in [
        (
            &(|| fs::write(data.join(image), &whole[..99]).unwrap()) as &dyn Fn(),
            [image, "not a whole PNG"],
        ),
        (
            &|| fs::write(data.join(image), fs::read(&other).unwrap()).unwrap(),
            [image, "is altered"],
        ),
        (
            &|| edited("\"angle_deg\":2.5", "\"angle_deg\":2.4"),
            ["manifest.jsonl", "half of step 5"],
        ),
        (
            &|| edited("\"step\":5", "\"step\":"),
            ["manifest.jsonl", "expected value"],
        ),
        (
            &|| edited(&first_row, ""),
            ["depth_cam_left_0.0.png", "not in manifest.jsonl"],
        ),
        (
            &|| edited(&first_row, &first_row.repeat(2)),
            ["depth_cam_left_0.0.png", "twice"],
        ),
    ] {
        let said = said_after(edit);
        assert!(parts.iter().all(|part| said.contains(part)), "{said}");
    }
    succeed(folder.path(), "dataset check data");
}

#[test]
fn persons_are_split_and_leaks_refused() {
    let folder = copy();
    let data = folder.path().join("data");
    let said = fail(folder.path(), "dataset split data");
    assert!(
        said.contains("1 persons leave the part val empty"),
        "{said}"
    );
    succeed(folder.path(), "dataset split data --part train=1");
    let path = data.join("splits/default.json");
    let split: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    assert_eq!(split["parts"]["train"], serde_json::json!([3]));
    let said = succeed(folder.path(), "dataset check data");
    assert!(said.contains("splits by person: default"), "{said}");
    let leak = r#"{"version": 1, "parts": {"train": [3], "test": [3]}}"#;
    fs::write(&path, leak).unwrap();
    let said = fail(folder.path(), "dataset check data");
    for part in ["default.json", "patient 3 stands in test and in train"] {
        assert!(said.contains(part), "{said}");
    }
    for (command, part) in [
        ("dataset split data --name ../x", "--name"),
        ("dataset split data", "is there already"),
    ] {
        let said = fail(folder.path(), command);
        assert!(said.contains(part), "{said}");
    }
    assert_eq!(names(&data.join("splits")), ["default.json"]);
}
