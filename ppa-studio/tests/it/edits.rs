//! Landmarks changed by a user, and the files that hold them.

use axum::http::StatusCode;
use ppa_generate::{Case, Plan, PreparedLimb};
use serde_json::json;

use crate::browser::Browser;

#[test]
fn a_choice_is_saved_beside_the_case_with_its_comments() {
    let browser = Browser::new();
    let before = std::fs::read_to_string(&browser.case).unwrap();
    let commented = before.replace("\n[surface]\n", "\n# Looked at on Monday.\n[surface]\n");
    std::fs::write(&browser.case, &commented).unwrap();

    let state = browser.get("/api/state").json();
    let mut joint: [f64; 3] =
        serde_json::from_value(state["landmarks"]["joint_centre"].clone()).unwrap();
    joint[0] += 4.0;
    let state = browser
        .post("/api/choices", &json!({ "joint_centre": joint }))
        .json();
    assert_eq!(state["choices"]["joint_centre"], json!(joint));
    assert_eq!(state["can_undo"], true);

    // The commands find the same as the page shows.
    assert_eq!(std::fs::read_to_string(&browser.case).unwrap(), commented);
    let edited = browser.folder.path().join("p01.edited.case.toml");
    let text = std::fs::read_to_string(&edited).unwrap();
    assert!(text.contains("# Looked at on Monday."), "{text}");
    let case = Case::read(&edited).unwrap();
    assert_eq!(case.choices.joint_centre, Some(joint));
    let found = PreparedLimb::of_case(&case).unwrap().landmarks;
    let found = serde_json::to_value(&found).unwrap();
    assert_eq!(found, state["landmarks"]);

    let state = browser.post("/api/undo", &json!({})).json();
    assert_eq!(state["landmarks"], state["automatic"]);
    let state = browser.post("/api/redo", &json!({})).json();
    assert_eq!(state["choices"]["joint_centre"], json!(joint));

    // The original is overwritten on request only.
    let state = browser.post("/api/save", &json!({})).json();
    assert_eq!(state["files"]["has_edits"], false);
    assert!(!edited.exists());
    let text = std::fs::read_to_string(&browser.case).unwrap();
    assert!(text.contains("# Looked at on Monday."));
    assert_eq!(Case::read(&browser.case).unwrap(), case);
}

#[test]
fn changes_are_taken_up_again_by_the_next_studio() {
    let browser = Browser::new();
    let changed = json!({ "joint_region": [8.0, 20.0] });
    browser.post("/api/choices", &changed).json();
    let Browser { folder, case, .. } = browser;
    let next = Browser::of(folder, case);
    let state = next.get("/api/state").json();
    assert_eq!(state["choices"]["joint_region"], json!([8.0, 20.0]));
    assert_eq!(state["files"]["has_edits"], true);
}

#[test]
fn a_page_with_another_limb_changes_nothing() {
    let browser = Browser::new();
    let before = browser.get("/api/state").json();
    let joint = json!({ "joint_centre": [1.0, 2.0, 3.0] });
    let refused = browser.post("/api/choices?limb=p02.case.toml", &joint);
    assert_eq!(refused.status, StatusCode::CONFLICT);
    assert!(
        refused
            .text()
            .contains("p01.case.toml is open in another page")
    );
    assert_eq!(browser.get("/api/state").json(), before);
    let shown = before["files"]["original"].as_str().unwrap();
    let path = format!("/api/choices?limb={shown}");
    let after = browser.post(&path, &json!({ "joint_region": [8.0, 20.0] }));
    assert_eq!(after.json()["can_undo"], true);
}

#[test]
fn a_plan_keeps_its_case_when_the_changes_replace_it() {
    let browser = Browser::new();
    let region = json!({ "joint_region": [8.0, 20.0] });
    browser.post("/api/choices", &region).json();
    let plan = browser.post("/api/plan/save", &json!({})).json();
    assert_eq!(plan["limbs"][0]["case"], "p01.edited.case.toml");
    browser.post("/api/save", &json!({})).json();
    let plan = browser.get("/api/plan/form").json();
    assert_eq!(plan["limbs"][0]["case"], "p01.case.toml");
    let plan = Plan::read(plan["current"].as_str().unwrap().as_ref()).unwrap();
    let case = Case::read(&plan.cases[0].file).unwrap();
    assert_eq!(case.choices.joint_region, Some([8.0, 20.0]));
}

#[test]
fn a_saved_plan_is_the_one_in_use() {
    let browser = Browser::new();
    let limb = json!({ "patient": 0, "side": "r" });
    let refused = browser.post("/api/dataset/open", &limb);
    assert!(
        refused.text().contains("has no case for"),
        "{}",
        refused.text()
    );
    browser.post("/api/plan/save", &json!({})).json();
    browser.post("/api/dataset/open", &limb).json();
}

#[test]
fn what_finds_nothing_changes_nothing() {
    let browser = Browser::new();
    let before = browser.get("/api/state").json();
    let refused = browser.post("/api/choices", &json!({ "joint_region": [20.0, 8.0] }));
    assert_eq!(refused.status, StatusCode::UNPROCESSABLE_ENTITY);
    assert!(!refused.text().is_empty());
    let refused = browser.post("/api/surface", &json!({ "iso_hu": 3000.0 }));
    assert_eq!(refused.status, StatusCode::UNPROCESSABLE_ENTITY);
    assert_eq!(browser.get("/api/state").json(), before);
}

#[test]
fn a_file_that_another_program_changed_is_kept() {
    let browser = Browser::new();
    let decisions = || {
        let mut state = browser.get("/api/state").json();
        state["files"].take();
        state
    };
    let before = decisions();
    let edited = browser.folder.path().join("p01.edited.case.toml");
    std::fs::write(&edited, "somebody else's").unwrap();
    let refused = browser.post("/api/choices", &json!({ "joint_region": [8.0, 20.0] }));
    assert_eq!(refused.status, StatusCode::CONFLICT);
    assert!(
        refused.text().contains("another program"),
        "{}",
        refused.text()
    );
    assert_eq!(std::fs::read_to_string(&edited).unwrap(), "somebody else's");
    // Changes that were not saved are not shown.
    assert_eq!(decisions(), before);
}

#[test]
fn a_saved_plan_holds_the_sliders_and_is_not_replaced_unasked() {
    let browser = Browser::new();
    let what_if = json!({ "angle_deg": 18.0, "distal_mm": 3.0, "kvp": 55.0, "mas": 4.0, "grid": true, "sensor": true });
    let saved = browser
        .post("/api/plan", &json!({ "what_if": what_if }))
        .json();
    let file = saved["file"].as_str().unwrap();
    let plan = Plan::read(file.as_ref()).unwrap();
    assert_eq!(plan.soft_tissue.distal_mm, 3.0);
    assert_eq!(plan.xray.kvp, 55.0);
    assert!(plan.xray.receptor.grid.is_some() && plan.depth.sensor.is_some());
    assert_eq!(plan.cases.len(), 1);
    let again = browser.post("/api/plan", &json!({ "what_if": {} }));
    assert_eq!(again.status, StatusCode::CONFLICT);
    assert_eq!(Plan::read(file.as_ref()).unwrap(), plan);
    let replaced = json!({ "what_if": {}, "replace": true });
    assert_eq!(browser.post("/api/plan", &replaced).status, StatusCode::OK);
}

#[test]
fn a_crop_and_a_point_in_the_limb_are_decisions_of_the_case() {
    let browser = Browser::new();
    let whole = browser.get("/api/state").json();
    let size: [usize; 3] = serde_json::from_value(whole["grid"]["size"].clone()).unwrap();
    // The end of the calf.
    let crop = json!({ "low": [0, 0, 0], "high": [size[0], size[1], size[2] - 5] });
    let state = browser
        .post("/api/surface", &json!({ "crop": crop }))
        .json();
    assert_eq!(state["crop"], crop);
    assert!(state["report"]["limb_voxels"].as_u64() < whole["report"]["limb_voxels"].as_u64());
    let prepare = state["commands"]["prepare"].as_str().unwrap();
    assert!(prepare.contains(" --crop 0,"), "{prepare}");
    let edited = browser.folder.path().join("p01.edited.case.toml");
    let case = Case::read(&edited).unwrap();
    let limb = PreparedLimb::of_case(&case).unwrap();
    assert_eq!(json!(limb.limb.report), state["report"]);

    let centre = whole["report"]["bodies"][0]["centre_mm"].clone();
    let state = browser
        .post("/api/surface", &json!({ "crop": null, "inside": centre }))
        .json();
    assert_eq!((&state["crop"], &state["inside"]), (&json!(null), &centre));
    assert_eq!(state["report"], whole["report"]);

    for (change, expected) in [
        (json!({ "inside": [1e3, 0.0, 0.0] }), "not in solid tissue"),
        (
            json!({ "crop": { "low": [0, 0, 0], "high": [1, 1, 9999] } }),
            "does not fit",
        ),
    ] {
        let refused = browser.post("/api/surface", &change);
        assert_eq!(refused.status, StatusCode::UNPROCESSABLE_ENTITY);
        assert!(refused.text().contains(expected), "{}", refused.text());
    }
    assert!(Case::read(&edited).unwrap().surface.inside.is_some());
}
