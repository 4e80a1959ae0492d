//! `--series`, `--fill-gaps` and `--force`: what they accept, and cases that record them.

use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use dicom_core::{DataElement, PrimitiveValue, Tag, VR};
use dicom_dictionary_std::tags;
use serde_json::Value;

use crate::{fail, names, shared, succeed};

/// A phantom as DICOM slices, made once.
fn slices() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        succeed(
            folder.path(),
            "ct phantom --spacing-mm 3 --table --out slices",
        );
        folder
    });
    folder.path()
}

/// Copies the slices into `folder`, under names that start with `prefix`, with other attributes.
fn copy_with(folder: &Path, prefix: &str, changes: &[(Tag, VR, &str)]) {
    fs::create_dir_all(folder).unwrap();
    let scan = slices().join("slices");
    for name in names(&scan) {
        let mut object = dicom_object::open_file(scan.join(&name)).unwrap();
        for &(tag, vr, text) in changes {
            object.put(DataElement::new(tag, vr, PrimitiveValue::from(text)));
        }
        object
            .write_to_file(folder.join(format!("{prefix}{name}")))
            .unwrap();
    }
}

fn report(folder: &Path, arguments: &str) -> Value {
    serde_json::from_str(&succeed(folder, &format!("{arguments} --json"))).unwrap()
}

fn codes(report: &Value) -> Vec<&str> {
    let warnings = report["warnings"].as_array().unwrap().iter();
    warnings.map(|w| w["code"].as_str().unwrap()).collect()
}

/// Prepares with an option, then uses the case with and without the line that records it.
fn assert_remembered(folder: &Path, option: &str, line: &str, refusal: &str) {
    let said = fail(folder, "prepare scan --side r --out case.toml");
    assert!(said.contains(refusal), "{said}");
    succeed(
        folder,
        &format!("prepare scan --side r --limb other --out case.toml {option}"),
    );
    let case = fs::read_to_string(folder.join("case.toml")).unwrap();
    assert_eq!(case.lines().filter(|l| *l == line).count(), 1, "{case}");
    succeed(folder, "scene place case.toml --angle 18");
    let forgotten = case.replace(&format!("{line}\n"), "");
    fs::write(folder.join("case.toml"), forgotten).unwrap();
    let said = fail(folder, "scene place case.toml --angle 18");
    assert!(said.contains(refusal), "{said}");
}

#[test]
fn gaps_are_filled_only_when_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    copy_with(&folder.join("scan"), "", &[]);
    for missing in ["slice_0011.dcm", "slice_0012.dcm", "slice_0030.dcm"] {
        fs::remove_file(folder.join("scan").join(missing)).unwrap();
    }
    for command in ["ct info scan", "ct convert scan out.nrrd"] {
        let said = fail(folder, command);
        assert!(
            said.contains("9.000 mm after slice 9, 6.000 mm after slice 26"),
            "{said}"
        );
    }
    assert_eq!(names(folder), ["scan"]);
    let whole = report(slices(), "ct info slices");
    let filled = report(folder, "ct info scan --fill-gaps");
    for key in ["size", "spacing_mm", "origin_mm"] {
        assert_eq!(filled[key], whole[key], "{key}");
    }
    assert_eq!(
        filled["acquisition"]["interpolated_slices"],
        serde_json::json!([10, 11, 29])
    );
    assert_eq!(codes(&filled), ["gaps-filled"]);
    let extract = "mesh extract scan --out skin.ply";
    assert!(fail(folder, extract).contains("9.000 mm after slice 9"));
    let skin = report(folder, &format!("{extract} --fill-gaps"));
    let whole = report(slices(), "mesh extract slices --out whole.ply");
    let area = |skin: &Value| skin["area_mm2"].as_f64().unwrap();
    assert!(
        (area(&skin) / area(&whole) - 1.0).abs() < 0.02,
        "{skin} and {whole}"
    );
    let voxels = |arguments: &str| report(folder, arguments)["voxels"].clone();
    assert!(fail(folder, "xray audit scan").contains("9.000 mm after slice 9"));
    let audited = report(slices(), "xray audit slices");
    assert_eq!(voxels("xray audit scan --fill-gaps"), audited["voxels"]);
    // The file cannot show filled gaps; the printed report does.
    let converted = report(folder, "ct convert scan out.nrrd --fill-gaps");
    assert_eq!(codes(&converted), ["gaps-filled"]);
    assert_remembered(
        folder,
        "--fill-gaps",
        "fill_gaps = true",
        "not evenly spaced",
    );
}

#[test]
fn one_of_several_series_is_chosen_by_number_or_uid() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    copy_with(&folder.join("scan"), "a_", &[]);
    copy_with(
        &folder.join("scan"),
        "b_",
        &[
            (tags::SERIES_INSTANCE_UID, VR::UI, "2.25.4711"),
            (tags::SERIES_NUMBER, VR::IS, "7"),
            // Distinguished by their values: one HU more.
            (tags::RESCALE_INTERCEPT, VR::DS, "1001.5"),
        ],
    );
    let said = fail(folder, "ct info scan");
    assert!(
        said.contains("number 1") && said.contains("number 7"),
        "{said}"
    );
    let first = report(folder, "ct info scan --series 1");
    assert_eq!(
        first["hu_sum"],
        report(slices(), "ct info slices")["hu_sum"],
        "series 1 is the phantom"
    );
    report(folder, "mesh extract scan --series 1 --out skin.ply");
    for choice in ["7", "2.25.4711"] {
        let seventh = report(folder, &format!("ct info scan --series {choice}"));
        assert_ne!(seventh["hu_sum"], first["hu_sum"]);
        assert_eq!(seventh["series"][1]["read"], true);
    }
    let said = fail(folder, "ct info scan --series 3");
    assert!(said.contains("does not hold the chosen series"), "{said}");
    let said = fail(slices(), "ct info slices/slice_0001.dcm --series 3");
    assert!(said.contains("does not hold the chosen series"), "{said}");
    assert_remembered(folder, "--series 1", "series = 1", "2 series");
}

/// A colour page of doses that claims to be CT.
#[test]
fn a_colour_page_beside_a_series_is_listed_with_reason() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    copy_with(&folder.join("scan"), "a_", &[]);
    copy_with(
        &folder.join("scan"),
        "b_",
        &[
            (tags::SERIES_INSTANCE_UID, VR::UI, "2.25.4711"),
            (tags::SERIES_NUMBER, VR::IS, "999"),
            (tags::PHOTOMETRIC_INTERPRETATION, VR::CS, "RGB"),
        ],
    );
    let reason = "refused: PhotometricInterpretation is RGB";
    let said = fail(folder, "ct info scan");
    assert!(said.contains(reason), "{said}");
    let said = succeed(folder, "ct info scan --series 1");
    assert!(said.contains(reason), "{said}");
    let said = fail(folder, "ct info scan --series 999");
    assert!(said.contains("PhotometricInterpretation is RGB"), "{said}");
}

#[test]
fn another_modality_needs_force_and_is_never_called_ct() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    copy_with(&folder.join("scan"), "", &[(tags::MODALITY, VR::CS, "MR")]);
    let said = fail(folder, "ct info scan");
    assert!(said.contains("modality MR, not CT"), "{said}");
    let forced = report(folder, "ct info scan --force");
    assert_eq!(forced["modality"], "MR");
    assert_eq!(codes(&forced), ["not-ct"]);

    let said = fail(folder, "ct convert scan slices --force");
    assert!(said.contains("the scan holds modality MR"), "{said}");
    assert_eq!(names(folder), ["scan"]);
    let converted = report(folder, "ct convert scan mr.nii --force");
    assert_eq!(converted["hu_sum"], forced["hu_sum"]);
    assert_eq!(codes(&converted), ["not-ct"]);
    assert_remembered(folder, "--force", "force = true", "modality MR");
}

#[test]
fn units_of_free_text_are_refused_and_not_repeated() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scan = folder.join("scan");
    for (tag, vr, text, expected) in [
        (tags::RESCALE_TYPE, VR::LO, "DOE JANE", "another unit"),
        (tags::MODALITY, VR::CS, "DOE JANE", "no DICOM term"),
        (
            tags::PIXEL_SPACING,
            VR::DS,
            "DOE JANE",
            "PixelSpacing is text",
        ),
        (tags::RESCALE_TYPE, VR::LO, "Z_EFF", "Z_EFF"),
    ] {
        copy_with(&scan, "", &[(tag, vr, text)]);
        let said = fail(folder, "ct info scan");
        assert!(said.contains(expected) && !said.contains("DOE"), "{said}");
        if tag != tags::PIXEL_SPACING {
            let forced = succeed(folder, "ct info scan --force --json");
            assert!(
                forced.contains(expected) && !forced.contains("DOE"),
                "{forced}"
            );
            let said = fail(folder, "ct convert scan slices --force");
            assert!(said.contains(expected) && !said.contains("DOE"), "{said}");
        }
    }
    assert_eq!(names(folder), ["scan"]);
}

#[test]
#[ignore = "needs ../shared/data"]
fn real_scans_pass_when_asked_to() {
    let folder = tempfile::tempdir().unwrap();
    for (path, option, code) in [
        ("hand-reencoded/dicom-gaps", "--fill-gaps", "gaps-filled"),
        (
            "geometry-only-noise/missing-slice",
            "--fill-gaps",
            "gaps-filled",
        ),
        (
            "geometry-only-noise/tilt-missing-slice",
            "--fill-gaps",
            "gaps-filled",
        ),
        ("mr-not-ct/compressed_jpegls", "--force", "not-ct"),
    ] {
        let path = shared().join("data").join(path).display().to_string();
        fail(folder.path(), &format!("ct convert {path} out.mha"));
        let info = report(folder.path(), &format!("ct info {path} {option}"));
        assert!(codes(&info).contains(&code), "{path}: {info}");
        let converted = report(
            folder.path(),
            &format!("ct convert {path} out.mha {option}"),
        );
        assert!(codes(&converted).contains(&code), "{path}: {converted}");
        assert_eq!(converted["hu_sum"], info["hu_sum"], "{path}");
        fs::remove_file(folder.path().join("out.mha")).unwrap();
    }
}
