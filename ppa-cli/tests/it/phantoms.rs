//! `ppa ct phantom`: the family, sides, plate, labels, scanner and knee.

use std::fs;

use serde_json::Value;

use crate::{fail, names, succeed};

fn made(folder: &std::path::Path, arguments: &str) -> Value {
    let said = succeed(folder, &format!("ct phantom {arguments} --json"));
    assert!(!said.to_lowercase().contains("patient"), "{said}");
    serde_json::from_str(&said).unwrap()
}

#[test]
fn the_joint_that_prepare_finds_is_that_of_the_phantom() {
    let folder = tempfile::tempdir().unwrap();
    for (name, side) in [("--name P07", "l"), ("--name P12", "r")] {
        let arguments =
            format!("{name} --side {side} --table --spacing-mm 2 --replace --out leg.nii");
        let truth = &made(folder.path(), &arguments)["truth"];
        let prepare = format!("prepare leg.nii --side {side} --replace --out leg.toml --json");
        let case: Value = serde_json::from_str(&succeed(folder.path(), &prepare)).unwrap();
        let found = &case["found"]["landmarks"]["joint_centre"];
        for axis in 0..3 {
            let [found, expected] =
                [found, &truth["joint_centre"]].map(|point| point[axis].as_f64().unwrap());
            assert!(
                (found - expected).abs() < 4.0,
                "{name}: {found} for {expected}"
            );
        }
    }
}

#[test]
fn plate_labels_and_noise_are_in_the_files() {
    let folder = tempfile::tempdir().unwrap();
    let info = |file: &str| -> Value {
        let said = succeed(folder.path(), &format!("ct info {file} --json"));
        serde_json::from_str(&said).unwrap()
    };
    let whole = "--name p05 --spacing-mm 3 --out whole.nii";
    let plain = made(folder.path(), whole);
    assert_eq!(plain["phantom"], "P05, right lower leg");
    let report = made(
        folder.path(),
        "--name P05 --spacing-mm 3 --plate --labels bones.nii.gz --noise-hu 20 --blur-mm 1 --out metal.nii",
    );
    assert_eq!(report["labels"].as_array().unwrap().len(), 30);
    assert_eq!(report["labels"][0], "talus");
    assert_eq!(info("bones.nii.gz")["size"], info("metal.nii")["size"]);
    assert!(info("bones.nii.gz")["hu_max"].as_f64().unwrap() <= 30.0);
    let [metal, bone] =
        ["metal.nii", "whole.nii"].map(|file| info(file)["hu_max"].as_f64().unwrap());
    assert!(metal > bone + 300.0, "{metal} and {bone}");
    // Noise in the air.
    assert!(info("metal.nii")["hu_min"].as_f64().unwrap() < -1020.0);
    assert_eq!(info("whole.nii")["hu_min"], -1000.0);
}

#[test]
fn a_knee_can_be_prepared() {
    let folder = tempfile::tempdir().unwrap();
    let knee = made(
        folder.path(),
        "--limb knee --side l --table --spacing-mm 2 --out knee.nii",
    );
    assert_eq!(knee["phantom"], "left knee");
    assert!(knee.get("truth").is_none());
    let case = succeed(
        folder.path(),
        "prepare knee.nii --side l --out knee.toml --json",
    );
    let case: Value = serde_json::from_str(&case).unwrap();
    let found = &case["found"]["landmarks"];
    assert_eq!(found["limb"], "knee");
    let joint = [0, 1, 2].map(|axis| found["joint_centre"][axis].as_f64().unwrap());
    // Middle of the plateau of the phantom.
    let off = [95.0, 12.0, -151.0]
        .into_iter()
        .zip(joint)
        .map(|(a, b)| (a - b).powi(2));
    assert!(off.sum::<f64>().sqrt() < 2.0, "{joint:?}");
    assert!(
        fs::read_to_string(folder.path().join("knee.toml"))
            .unwrap()
            .contains("limb = \"knee\"")
    );
    let said = fail(
        folder.path(),
        "prepare knee.nii --side l --limb lower-leg --out leg.toml",
    );
    assert!(
        said.contains("no ankle found, but the knee is near 95, 1"),
        "{said}"
    );
    assert!(said.contains("--limb knee"), "{said}");
    let said = fail(
        folder.path(),
        "prepare knee.nii --side l --segment-bones b.nii --out leg.toml",
    );
    assert!(said.contains("labels of ankles"), "{said}");
    assert!(!folder.path().join("leg.toml").exists() && !folder.path().join("b.nii").exists());
}

#[test]
fn what_makes_no_phantom_is_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, word) in [
        ("ct phantom --name P18 --out a.nii", "P01 to P17"),
        ("ct phantom --limb knee --plate --out a.nii", "--plate"),
        (
            "ct phantom --spacing-mm 4 --noise-hu=-1 --out a.nii",
            "0 to 1000",
        ),
        (
            "ct phantom --spacing-mm 4 --blur-mm=NaN --out a.nii",
            "0 to 20",
        ),
        ("demo --phantom Q1 --out demo", "P01 to P17"),
        (
            "ct phantom --spacing-mm 0.25 --out a.nii",
            "expected at most 5.4e8",
        ),
        (
            "ct phantom --spacing-mm 8 --out a.xyz --labels b.nii",
            ".nrrd",
        ),
        (
            "ct phantom --spacing-mm 8 --out a.nii --labels b.xyz",
            ".nrrd",
        ),
        (
            "ct phantom --spacing-mm 8 --out a.nii --labels a.nii",
            "two different files",
        ),
        (
            "ct phantom --spacing-mm 8 --out a.nii --labels ./a.nii",
            "two different files",
        ),
        (
            "ct phantom --spacing-mm 8 --out a.nii --labels bones",
            "numbers of bones",
        ),
        (
            "ct phantom --spacing-mm 8 --out a.nii --labels bones/",
            "numbers of bones",
        ),
        (
            "ct phantom --spacing-mm 8 --out a.nii --labels .",
            "numbers of bones",
        ),
    ] {
        let said = fail(folder.path(), arguments);
        assert!(said.contains(word), "{arguments}: {said}");
    }
    assert!(names(folder.path()).is_empty());
}
