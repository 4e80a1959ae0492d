//! Cameras and the table of materials in the form of a plan.

use std::path::Path;

use axum::http::StatusCode;
use ppa_depth::{CameraSpec, DepthMode, RigSpec};
use ppa_generate::Plan;
use ppa_xray::HuCalibration;
use serde_json::{Value, json};

use crate::browser::{Answer, Browser};
use crate::plans::plan;

/// A table in which everything except air is water.
pub const WATER: &str = "\
[[segment]]
name = \"air\"
material = \"air\"
density = [[-1000, 0.001205]]

[[segment]]
name = \"water\"
from_hu = -500
material = \"water\"
density = [[0, 1.0]]
";

/// Writes a rig with small images, and a table of materials, next to the plan.
pub fn write_files(folder: &Path) -> RigSpec {
    let mut rig = RigSpec::default();
    for mounted in [&mut rig.left, &mut rig.right] {
        mounted.camera = CameraSpec::azure_kinect(DepthMode::NfovBinned);
    }
    let text = serde_json::to_string(&rig).unwrap();
    std::fs::write(folder.join("small.rig.json"), text).unwrap();
    std::fs::write(folder.join("water.toml"), WATER).unwrap();
    rig
}

fn opened() -> (Browser, RigSpec) {
    let folder = tempfile::tempdir().unwrap();
    let file = plan(folder.path());
    let rig = write_files(folder.path());
    (Browser::of(folder, file), rig)
}

fn set(browser: &Browser, key: &str, value: Value) -> Answer {
    browser.post("/api/plan/key", &json!({ "key": key, "value": value }))
}

fn field(form: &Value, key: &str) -> Value {
    let fields = form["fields"].as_array().unwrap();
    let found = fields.iter().find(|field| field["key"] == key);
    found.unwrap_or_else(|| panic!("no {key}")).clone()
}

fn edited(browser: &Browser) -> Plan {
    Plan::read(&browser.folder.path().join("ankles.edited.toml")).unwrap()
}

/// Returns the total columns of both depth images in step 5.
fn columns(browser: &Browser) -> u32 {
    let answer = browser.post("/api/depth", &json!({ "angle_deg": 5.0 }));
    assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
    image::load_from_memory(&answer.body).unwrap().width()
}

#[test]
fn files_are_offered_where_they_can_be_read() {
    let (browser, _) = opened();
    let folder = browser.folder.path();
    std::fs::write(folder.join("odd.json"), "{}").unwrap();
    std::fs::write(folder.join("odd.toml"), WATER.replace("[[0, 1.0]]", "[]")).unwrap();
    std::fs::create_dir(folder.join("below")).unwrap();
    std::fs::write(folder.join("below/water.toml"), WATER).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(folder.join("water.toml"), folder.join("link.toml")).unwrap();
    let form = browser.get("/api/plan/form").json();
    let offered = |key: &str| {
        let field = field(&form, key);
        assert_eq!(field["kind"], "file");
        field["names"].clone()
    };
    // An unreadable table is named with the reason; JSON without a rig is ignored.
    let unreadable = |key: &str| field(&form, key)["unreadable"].clone();
    assert_eq!(unreadable("depth.rig"), json!([]));
    let reason = &unreadable("xray.calibration_file")[0];
    assert_eq!(reason[0], "odd.toml");
    assert!(
        reason[1].as_str().unwrap().contains("has no density knots"),
        "{reason}"
    );
    let rig = json!([["small.rig.json", "both 320 x 288 pixels"]]);
    assert_eq!(offered("depth.rig"), rig);
    let table = json!([["water.toml", "air, water"]]);
    assert_eq!(offered("xray.calibration_file"), table);
}

#[test]
fn a_chosen_rig_holds_for_images_and_forecast() {
    let (browser, rig) = opened();
    let bytes = || {
        let body = json!({ "folder": "ankles" });
        let forecast = browser.post("/api/forecast", &body).json();
        forecast["bytes"].as_u64().unwrap()
    };
    let (usual, before) = (columns(&browser), bytes());
    let form = set(&browser, "depth.rig", json!("small.rig.json")).json();
    assert_eq!((usual, columns(&browser)), (1280, 640));
    assert!(bytes() < before * 3 / 4, "{} of {before}", bytes());
    let focal = "depth.cameras.left.camera.fx";
    let shown = field(&form, focal)["default"].as_str().unwrap().parse();
    assert_eq!(shown, Ok(rig.left.camera.fx));

    // Changing a camera writes out the rig, and is undone and redone as one change.
    let form = set(&browser, focal, json!("260.5")).json();
    let expected = {
        let mut rig = rig.clone();
        rig.left.camera.fx = 260.5;
        rig
    };
    assert_eq!(edited(&browser).depth.cameras, Some(expected));
    assert_eq!(edited(&browser).depth.rig, None);
    assert_eq!(field(&form, "depth.rig")["instead"], "depth.cameras");
    assert_eq!(field(&form, focal)["required"], true);
    let text = std::fs::read_to_string(browser.folder.path().join("ankles.edited.toml"));
    assert!(text.unwrap().contains("step_deg = 5.0    # coarse"));
    assert_eq!(columns(&browser), 640);
    browser.post("/api/plan/undo", &json!({})).json();
    assert_eq!(edited(&browser).depth.cameras, None);
    browser.post("/api/plan/redo", &json!({})).json();
    assert_eq!(edited(&browser).depth.rig, None);

    for (key, value, says) in [
        (focal, json!("-3"), "camera focal length fx is -3"),
        (focal, Value::Null, "missing field `fx`"),
        (
            "depth.cameras.left.camera.model",
            json!("fisheye"),
            "unknown variant `fisheye`",
        ),
        (
            "depth.cameras.right.device_from_camera",
            json!("[[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]"),
            "device_from_camera of the right camera",
        ),
    ] {
        let answer = set(&browser, key, value);
        assert_eq!(answer.status, StatusCode::UNPROCESSABLE_ENTITY, "{key}");
        assert!(answer.text().contains(says), "{}", answer.text());
    }
    let form = set(&browser, "depth.rig", Value::Null).json();
    assert_eq!(field(&form, "depth.rig")["instead"], Value::Null);
    assert_eq!(columns(&browser), usual);
}

#[test]
fn a_chosen_table_of_materials_holds_for_radiographs() {
    let (browser, _) = opened();
    let radiograph = || {
        let pose = json!({ "angle_deg": 5.0 });
        let answer = browser.post("/api/radiograph/first", &pose);
        assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
        answer.body
    };
    let names = |form: &Value| {
        let rows = form["materials"].as_array().unwrap().iter();
        rows.map(|row| row["segment"].as_str().unwrap().to_owned())
            .collect::<Vec<_>>()
    };
    let built_in = radiograph();
    let form = set(&browser, "xray.calibration_file", json!("water.toml")).json();
    assert_eq!(names(&form), ["air", "water"]);
    let table = HuCalibration::parse(WATER).unwrap();
    assert_eq!(edited(&browser).xray.calibration, table);
    assert_ne!(radiograph(), built_in);
    let form = browser.post("/api/plan/undo", &json!({})).json();
    assert_eq!(names(&form).len(), HuCalibration::default().segments.len());
    assert_eq!(radiograph(), built_in);
    for (file, says) in [
        ("ankles.toml", "HU calibration"),
        ("../water.toml", "not below the folder"),
    ] {
        let answer = set(&browser, "xray.calibration_file", json!(file));
        assert_eq!(answer.status, StatusCode::UNPROCESSABLE_ENTITY);
        assert!(answer.text().contains(says), "{}", answer.text());
    }
}
