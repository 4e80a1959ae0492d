//! The form of a plan, and the files that hold its changes.

use axum::http::StatusCode;
use ppa_generate::{Case, Plan};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::browser::Browser;
use crate::plans::plan;

fn opened() -> Browser {
    let folder = tempfile::tempdir().unwrap();
    let file = plan(folder.path());
    Browser::of(folder, file)
}

fn set(browser: &Browser, key: &str, value: Value) -> crate::browser::Answer {
    browser.post("/api/plan/key", &json!({ "key": key, "value": value }))
}

fn field(form: &Value, key: &str) -> Value {
    let fields = form["fields"].as_array().unwrap();
    let found = fields.iter().find(|field| field["key"] == key);
    found.unwrap_or_else(|| panic!("no {key}")).clone()
}

#[test]
fn a_changed_setting_is_saved_beside_the_plan() {
    let browser = opened();
    let before = std::fs::read_to_string(&browser.case).unwrap();
    let form = browser.get("/api/plan/form").json();
    assert_eq!(form["dataset"], "ankles");
    assert_eq!(form["limbs"][0]["case"], "p01.case.toml");
    let step = field(&form, "rotation.step_deg");
    assert_eq!(
        (&step["value"], &step["default"]),
        (&json!("5.0"), &json!("0.5"))
    );
    let form = set(&browser, "rotation.step_deg", json!("2.5")).json();
    assert_eq!(field(&form, "rotation.step_deg")["value"], "2.5");
    assert_eq!(form["has_edits"], true);
    assert_eq!(std::fs::read_to_string(&browser.case).unwrap(), before);
    let edited = browser.folder.path().join("ankles.edited.toml");
    let text = std::fs::read_to_string(&edited).unwrap();
    assert_eq!(text, before.replace("step_deg = 5.0 ", "step_deg = 2.5 "));

    // Images of the page follow the plan, and the next studio goes on from there.
    set(&browser, "xray.kvp", json!("70")).json();
    assert_eq!(browser.get("/api/state").json()["planned"]["kvp"], 70.0);
    let Browser { folder, case, .. } = browser;
    let browser = Browser::of(folder, case);
    assert_eq!(browser.get("/api/state").json()["planned"]["kvp"], 70.0);

    // A change is undone and redone; the file follows.
    let edited_text = || std::fs::read_to_string(&edited).unwrap();
    let form = set(&browser, "xray.kvp", json!("80")).json();
    assert_eq!(
        (&form["can_undo"], &form["can_redo"]),
        (&json!(true), &json!(false))
    );
    let form = browser.post("/api/plan/undo", &json!({})).json();
    assert_eq!(field(&form, "xray.kvp")["value"], "70");
    assert_eq!(
        (&form["can_undo"], &form["can_redo"]),
        (&json!(false), &json!(true))
    );
    assert!(edited_text().contains("kvp = 70"), "{}", edited_text());
    assert_eq!(browser.get("/api/state").json()["planned"]["kvp"], 70.0);
    let form = browser.post("/api/plan/redo", &json!({})).json();
    assert_eq!(field(&form, "xray.kvp")["value"], "80");
    assert_eq!(
        (&form["can_undo"], &form["can_redo"]),
        (&json!(true), &json!(false))
    );
    assert!(edited_text().contains("kvp = 80"), "{}", edited_text());

    // Over the original on request alone; the default of a key is the key left out.
    set(&browser, "xray.kvp", Value::Null).json();
    let form = browser.post("/api/plan/save", &json!({})).json();
    assert_eq!(form["has_edits"], false);
    assert!(!edited.exists());
    let plan = Plan::read(&browser.case).unwrap();
    assert_eq!((plan.rotation.step_deg, plan.xray.kvp), (2.5, 60.0));
}

#[test]
fn settings_that_the_library_refuses_are_not_saved() {
    let browser = opened();
    let edited = browser.folder.path().join("ankles.edited.toml");
    for (key, value, words) in [
        ("rotation.step_deg", "0.3", "step_deg"),
        ("shapes.offset_mm", "-1", "expected a length above 0 mm"),
        ("xray.receptor.grid", "{ ratio = 8 }", "lines_per_cm"),
        ("depth.rig", "/etc/passwd", "not below the folder"),
        ("no.such", "1", "the form has no no.such"),
    ] {
        let answer = set(&browser, key, json!(value));
        assert_eq!(answer.status, StatusCode::UNPROCESSABLE_ENTITY, "{key}");
        assert!(answer.text().contains(words), "{}", answer.text());
    }
    assert!(!edited.exists());
    // Another program, or another studio.
    set(&browser, "seed", json!("8")).json();
    std::fs::write(&edited, "version = 1\n").unwrap();
    let answer = set(&browser, "seed", json!("9"));
    assert_eq!(answer.status, StatusCode::CONFLICT);
    assert_eq!(std::fs::read_to_string(&edited).unwrap(), "version = 1\n");
}

#[test]
fn a_case_without_a_plan_gets_one_with_all_keys() {
    let browser = Browser::new();
    let form = browser.get("/api/plan/form").json();
    assert_eq!(
        (&form["is_saved"], &form["dataset"]),
        (&json!(false), &json!("p01.plan"))
    );
    set(&browser, "rotation.step_deg", json!("30")).json();
    let edited = browser.folder.path().join("p01.plan.edited.toml");
    let text = std::fs::read_to_string(&edited).unwrap();
    assert!(text.contains("# Plan of a dataset"));
    let plan = Plan::read(&edited).unwrap();
    assert_eq!(plan.rotation.step_deg, 30.0);
    assert_eq!(
        Case::read(&plan.cases[0].file).unwrap().side,
        ppa_scene::Side::Right
    );
}

#[test]
fn the_plan_takes_the_changed_case_on_request() {
    let browser = opened();
    let state = browser.get("/api/state").json();
    let joint = state["landmarks"]["joint_centre"].clone();
    browser
        .post("/api/choices", &json!({ "joint_centre": joint }))
        .json();
    let form = browser.get("/api/plan/form").json();
    let limb = &form["limbs"][0];
    assert_eq!(
        (&limb["has_edits"], &limb["uses_edits"]),
        (&json!(true), &json!(false))
    );
    let change = |edits: bool| {
        let change = json!({ "number": 0, "edits": edits });
        browser.post("/api/plan/case", &change).json()
    };
    assert_eq!(change(true)["limbs"][0]["case"], "p01.edited.case.toml");
    let edited: &TempDir = &browser.folder;
    let plan = Plan::read(&edited.path().join("ankles.edited.toml")).unwrap();
    assert!(
        Case::read(&plan.cases[0].file)
            .unwrap()
            .choices
            .joint_centre
            .is_some()
    );
    assert_eq!(change(false)["limbs"][0]["case"], "p01.case.toml");
}
