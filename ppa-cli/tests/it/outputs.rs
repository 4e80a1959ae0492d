//! Outputs are checked before any work, and existing ones are kept without `--replace`.
//!
//! The inputs named here do not exist: an error that names an output was raised before any input was read.

use std::fs;

use crate::{contains, contents, fail, phantom, succeed};

/// Commands, each with its one output that already exists.
const OUTPUTS: &[(&str, &str)] = &[
    ("ct convert nowhere x.nii", "x.nii"),
    ("ct info nowhere --report x.html", "x.html"),
    ("ct phantom --out x.nii --spacing-mm 0", "x.nii"),
    (
        "ct phantom --out y.nii --labels x.nii --spacing-mm 0",
        "x.nii",
    ),
    ("prepare nowhere --side r --out x.toml", "x.toml"),
    ("prepare nowhere --side r --out y.toml --ply x.ply", "x.ply"),
    (
        "prepare nowhere --side r --out y.toml --segment-bones x.nii",
        "x.nii",
    ),
    ("mesh extract nowhere --out x.ply", "x.ply"),
    ("mesh augment nowhere --out x.stl", "x.stl"),
    ("scene room --plan nowhere --out x.ply", "x.ply"),
    (
        "scene room --plan nowhere --out y.ply --toml x.toml",
        "x.toml",
    ),
    (
        "scene room --plan nowhere --out y.ply --frames x.json",
        "x.json",
    ),
    ("scene place nowhere --ply x.ply", "x.ply"),
    ("scene place nowhere --frames x.json", "x.json"),
    ("depth render nowhere --out x.png", "x.png"),
    ("depth render nowhere --out x.png --frames 3", "x_0002.png"),
    ("depth render nowhere --out y.png --exr x.exr", "x.exr"),
    ("depth render nowhere --out y.png --preview x.png", "x.png"),
    ("depth render nowhere --out y.png --points x.ply", "x.ply"),
    ("depth camera nowhere --out x.json", "x.json"),
    ("depth fit-noise nowhere --out x.json", "x.json"),
    ("depth coverage nowhere --csv x.csv", "x.csv"),
    ("depth coverage nowhere --plot x.png", "x.png"),
    ("xray simulate nowhere --out x.png", "x.png"),
    ("xray simulate nowhere --exr x.exr", "x.exr"),
    ("xray simulate nowhere --dicom x.dcm", "x.dcm"),
    (
        "xray simulate nowhere --engine analog --dose-map x.nii.gz",
        "x.nii.gz",
    ),
    (
        "xray simulate nowhere --engine analog --tally x.tally",
        "x.tally",
    ),
    (
        "xray simulate nowhere --engine analog --out y.png",
        "y.png.tally",
    ),
    ("xray merge nowhere --out x.png", "x.png"),
    ("xray merge nowhere --out y.png --exr x.exr", "x.exr"),
    ("xray merge nowhere --out y.png --tally x.tally", "x.tally"),
    ("qa nowhere --out x.html", "x.html"),
    ("qa .", "qa.html"),
    ("export table nowhere --out x.csv", "x.csv"),
    ("learn export nowhere --out x.onnx", "x.onnx"),
    ("eval nowhere --out .", "evaluation.json"),
    ("eval nowhere --out .", "learning_curve.png"),
];

#[test]
fn an_existing_file_is_refused_before_any_work() {
    for (command, name) in OUTPUTS {
        let folder = tempfile::tempdir().unwrap();
        let here = folder.path();
        fs::write(here.join(name), "kept").unwrap();
        contains(&fail(here, command), &[name, "--replace"]);
        // With `--replace` the missing input is the next error, and the old file is kept.
        let said = fail(here, &format!("{command} --replace"));
        assert!(!said.contains("--replace"), "{command}: {said}");
        let kept = contents(here);
        assert_eq!(kept.len(), 1, "{command}: {kept:?}");
        assert_eq!(fs::read(here.join(name)).unwrap(), b"kept");
    }
}

#[test]
fn a_wrong_ending_is_refused_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    for (command, endings) in [
        ("xray simulate nowhere --out a.jpg", ".png"),
        ("xray simulate nowhere --exr a.png", ".exr"),
        ("xray simulate nowhere --dicom a.png", ".dcm or .dicom"),
        (
            "xray simulate nowhere --engine analog --dose-map a.exr",
            ".nii or .nii.gz",
        ),
        ("xray merge nowhere --out a.jpg", ".png"),
        ("depth render nowhere --out a.exr", ".png"),
        ("depth render nowhere --out a.png --points a.obj", ".ply"),
        ("depth coverage nowhere --plot a.svg", ".png"),
        ("depth camera nowhere --out a.yml", ".json"),
        ("prepare nowhere --side r --out leg.case", ".toml"),
        ("prepare nowhere --side r --out a.toml --ply a.vtk", ".stl"),
        ("mesh extract nowhere --out a", ".ply, .obj or .stl"),
        ("scene room --plan nowhere --out a.stl", ".ply or .obj"),
        ("scene place nowhere --frames a.toml", ".json"),
        ("ct convert nowhere a.dat", ".nii.gz"),
        ("ct info nowhere --report a.pdf", ".html"),
        ("qa nowhere --out a.pdf", ".html"),
        ("export table nowhere --out a.xlsx", ".csv"),
    ] {
        let said = fail(here, command);
        contains(&said, &["name", endings]);
    }
    assert!(contents(here).is_empty());
}

#[test]
fn a_missing_folder_is_reported_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    for command in [
        "xray simulate nowhere --out no/a.png",
        "xray simulate nowhere --out a.png --exr no/a.exr",
        "xray simulate nowhere --out a.png --dicom no/a.dcm",
        "xray simulate nowhere --engine analog --tally no/a.tally",
        "xray merge nowhere --out no/a.png",
        "depth render nowhere --out no/a.png",
        "mesh extract nowhere --out no/a.ply",
        "ct convert nowhere no/a.nii",
        "ct phantom --out no/a.nii --spacing-mm 0",
    ] {
        contains(&fail(here, command), &["the folder no does not exist"]);
    }
    // A file in the place of a folder.
    fs::write(here.join("no"), "a file").unwrap();
    for command in [
        "prepare nowhere --side r --out no/a.toml",
        "depth camera --out no/a.json",
        "qa nowhere --out no/a.html",
        "export bagit nowhere --out no/bag",
        "export webdataset nowhere --out no/shards",
        "dataset convert nowhere --out no/other",
        "eval nowhere --out no/evaluation",
    ] {
        contains(&fail(here, command), &["no is not a folder"]);
    }
    assert_eq!(contents(here).len(), 1);
}

#[test]
fn an_edited_case_is_replaced_on_request_only() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let scan = phantom().join("p01.nii");
    let prepare = format!("prepare {} --side r --out leg.case.toml", scan.display());
    succeed(here, &prepare);
    let path = here.join("leg.case.toml");
    let made = fs::read_to_string(&path).unwrap();
    let edited = format!("# checked by hand\n{made}");
    fs::write(&path, &edited).unwrap();
    contains(&fail(here, &prepare), &["leg.case.toml exists"]);
    assert_eq!(fs::read_to_string(&path).unwrap(), edited);
    // A failed replacement keeps the old file.
    let said = fail(here, &format!("{prepare} --replace --joint 9000,0,0"));
    assert!(!said.is_empty());
    assert_eq!(fs::read_to_string(&path).unwrap(), edited);
    succeed(here, &format!("{prepare} --replace"));
    assert_eq!(fs::read_to_string(&path).unwrap(), made);
}

#[test]
fn one_file_for_two_outputs_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for command in [
        "depth render nowhere --out x.png --preview ./x.png",
        "ct phantom --out x.nii --labels x.nii",
    ] {
        let said = fail(folder.path(), command);
        assert!(said.contains("name the same file"), "{said}");
    }
}
