//! An opened dataset: its poses, their images, and its limbs.

use axum::http::StatusCode;
use image::GenericImageView;
use ppa_dataset::Manifest;
use ppa_generate::Case;
use ppa_report::qa_page;
use serde_json::{Value, json};

use crate::browser::Browser;
use crate::plans::{LIMB, dataset};

fn opened() -> Browser {
    let folder = tempfile::tempdir().unwrap();
    let root = dataset(folder.path());
    Browser::of(folder, root)
}

fn quality(browser: &Browser) -> Value {
    browser.get("/api/dataset?folder=ankles").json()
}

#[test]
fn poses_and_outliers_are_those_of_the_quality_report() {
    let browser = opened();
    let found = quality(&browser);
    let poses = found["poses"].as_array().unwrap();
    assert_eq!(poses.len(), 11);
    let odd: Vec<&Value> = poses
        .iter()
        .filter(|pose| pose["stands_out"] != json!([]))
        .collect();
    let [odd] = odd[..] else { panic!("{odd:?}") };
    assert_eq!(odd["angle_deg"], 15.0);
    assert_eq!(odd["stands_out"], json!(["height of the joint"]));
    let report = qa_page(&browser.case).unwrap();
    let height = odd["height_mm"].as_f64().unwrap();
    let sentence = format!("orig, 15.0 degrees: height of the joint {height:.2} mm does not fit");
    assert!(report.contains(&sentence), "{sentence}");
    let labels: Vec<f64> = poses
        .iter()
        .map(|pose| pose["label"]["label"].as_f64().unwrap())
        .collect();
    assert!(labels.iter().all(|label| (1.0..=3.0).contains(label)));
    assert_eq!(poses[0]["label"]["source"], "surrogate-jso/2");
    assert_eq!(found["splits"][0]["parts"], json!([["test", [4]]]));
    assert_eq!(found["at_hand"], json!([LIMB]));
    assert_eq!(
        found["commands"]["quality"],
        format!("ppa qa {}", browser.case.display())
    );
    let checked = browser
        .post("/api/dataset/check", &json!({ "folder": "ankles" }))
        .json();
    assert_eq!(checked["depth_images"], 22);
    // The altered list.
    assert!(
        checked["flaws"].to_string().contains("manifest.jsonl"),
        "{checked}"
    );
}

#[test]
fn images_of_a_pose_are_the_files_of_the_dataset() {
    let browser = opened();
    let radiograph = browser.get("/api/dataset/radiograph/4/r/30?folder=ankles");
    let file = browser.case.join(LIMB.radiograph_png(30));
    assert_eq!(radiograph.body, std::fs::read(file).unwrap());
    let depth = browser.get("/api/dataset/depth/4/r/orig/30?folder=ankles");
    let shown = image::load_from_memory(&depth.body).unwrap();
    let manifest = Manifest::read(&browser.case).unwrap();
    let left = image::open(browser.case.join(&manifest.files[0].file)).unwrap();
    assert_eq!(shown.dimensions(), (2 * left.width(), left.height()));
    for path in [
        "/api/dataset/radiograph/4/r/31?folder=ankles",
        "/api/dataset/depth/4/r/big/30?folder=ankles",
        "/api/dataset/depth/4/r/orig/30?folder=..",
        "/api/dataset?folder=p01.case.toml",
    ] {
        let answer = browser.get(path);
        assert_eq!(answer.status, StatusCode::UNPROCESSABLE_ENTITY, "{path}");
    }
    let outside = browser.get("/api/dataset/depth/4/r/..%2F..%2Forig/30?folder=ankles");
    assert_eq!(outside.status, StatusCode::BAD_REQUEST);
}

#[test]
fn a_limb_is_opened_where_the_plan_names_its_case() {
    let browser = opened();
    let found = browser.get("/api/opened").json();
    assert_eq!(
        found,
        json!({ "limb": false, "plan": true, "watched": null, "dataset": "ankles" })
    );
    let closed = browser.get("/api/state");
    assert_eq!(closed.status, StatusCode::UNPROCESSABLE_ENTITY);
    assert!(
        closed.text().contains("no limb is open"),
        "{}",
        closed.text()
    );
    let other = browser.post("/api/dataset/open", &json!({ "patient": 4, "side": "l" }));
    assert!(
        other.text().contains("has no case for limb l of patient 4"),
        "{}",
        other.text()
    );
    let document = browser.post("/api/dataset/open", &json!(LIMB)).json();
    assert_eq!(document["name"], "p01.case.toml");
    assert_eq!(browser.get("/api/opened").json()["limb"], true);
    // Its decisions can be changed like those of an opened case.
    let joint = document["landmarks"]["joint_centre"].clone();
    browser
        .post("/api/choices", &json!({ "joint_centre": joint }))
        .json();
    let edited = browser.folder.path().join("p01.edited.case.toml");
    assert!(Case::read(&edited).unwrap().choices.joint_centre.is_some());
}

#[test]
fn a_dataset_without_its_plan_shows_its_poses_alone() {
    let folder = tempfile::tempdir().unwrap();
    let root = dataset(folder.path());
    std::fs::remove_file(folder.path().join("ankles.toml")).unwrap();
    let browser = Browser::of(folder, root);
    let found = browser.get("/api/opened").json();
    assert_eq!(
        found,
        json!({ "limb": false, "plan": false, "watched": null, "dataset": "ankles" })
    );
    assert_eq!(quality(&browser)["at_hand"], json!([]));
    assert_eq!(
        browser.get("/api/plan/form").status,
        StatusCode::UNPROCESSABLE_ENTITY
    );
    // An unfinished dataset has no list of images.
    std::fs::remove_file(browser.case.join(Manifest::FILE)).unwrap();
    let answer = browser.get("/api/dataset?folder=ankles");
    assert!(
        answer.text().contains("ankles/manifest.jsonl"),
        "{}",
        answer.text()
    );
}

#[test]
fn a_plan_without_its_dataset_has_no_poses_to_show() {
    let browser = Browser::new();
    let absent = browser.get("/api/dataset?folder=p01.plan");
    assert_eq!(absent.json(), serde_json::Value::Null);
    let outside = browser.get("/api/dataset?folder=..");
    assert_eq!(outside.status, StatusCode::UNPROCESSABLE_ENTITY);
}
