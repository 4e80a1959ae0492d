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

    // Images of the page follow the plan, and the next studio continues with it.
    set(&browser, "xray.kvp", json!("70")).json();
    assert_eq!(
        browser.get("/api/state").json()["planned"]["exposure"]["kvp"],
        70.0
    );
    let Browser { folder, case, .. } = browser;
    let browser = Browser::of(folder, case);
    assert_eq!(
        browser.get("/api/state").json()["planned"]["exposure"]["kvp"],
        70.0
    );

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
    assert_eq!(
        browser.get("/api/state").json()["planned"]["exposure"]["kvp"],
        70.0
    );
    let form = browser.post("/api/plan/redo", &json!({})).json();
    assert_eq!(field(&form, "xray.kvp")["value"], "80");
    assert_eq!(
        (&form["can_undo"], &form["can_redo"]),
        (&json!(true), &json!(false))
    );
    assert!(edited_text().contains("kvp = 80"), "{}", edited_text());

    // The original is overwritten on request only; a key is set to its default by removing it.
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
    // A change by another program or studio.
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
        let change = json!({ "case": { "number": 0, "edits": edits } });
        browser.post("/api/plan/limbs", &change).json()
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

#[test]
fn limbs_are_added_from_the_folder_and_removed() {
    let browser = opened();
    let folder = browser.folder.path();
    let case = std::fs::read_to_string(folder.join("p01.case.toml")).unwrap();
    // Another scan, identified by its hash, and the other leg of the same scan.
    let scan = Case::read(&folder.join("p01.case.toml"))
        .unwrap()
        .source
        .volume_sha256;
    let other = case.replace(&scan, &"0".repeat(scan.len()));
    std::fs::write(folder.join("p02.case.toml"), other).unwrap();
    let left = case.replacen("side = \"r\"", "side = \"l\"", 1);
    std::fs::write(folder.join("left.case.toml"), left).unwrap();
    let form = browser.get("/api/plan/form").json();
    assert_eq!(
        form["other_cases"],
        json!(["left.case.toml", "p02.case.toml"])
    );

    let change = |change: Value| browser.post("/api/plan/limbs", &change);
    let limbs = |form: &Value| {
        let limbs = form["limbs"].as_array().unwrap().iter();
        let limbs = limbs.map(|limb| {
            let case = limb["case"].as_str().unwrap();
            (case.to_owned(), limb["patient"].as_u64().unwrap())
        });
        limbs.collect::<Vec<_>>()
    };
    let named = |case: &str, patient| (case.to_owned(), patient);
    let first = named("p01.case.toml", 4);
    // The same scan gives the same patient, another scan the next.
    change(json!({ "add": { "case": "left.case.toml" } })).json();
    let form = change(json!({ "add": { "case": "p02.case.toml" } })).json();
    let left = named("left.case.toml", 4);
    let expected = [first.clone(), left, named("p02.case.toml", 5)];
    assert_eq!(limbs(&form), expected);
    assert_eq!(form["other_cases"], json!([]));
    let form = change(json!({ "patient": { "number": 2, "patient": 9 } })).json();
    assert_eq!(limbs(&form)[2], named("p02.case.toml", 9));
    let form = change(json!({ "remove": { "number": 1 } })).json();
    assert_eq!(limbs(&form), [first, named("p02.case.toml", 9)]);
    let text = std::fs::read_to_string(folder.join("ankles.edited.toml")).unwrap();
    assert!(
        text.starts_with("# Of the house.") && text.contains("# coarse"),
        "{text}"
    );
    let form = browser.post("/api/plan/undo", &json!({})).json();
    assert_eq!(limbs(&form).len(), 3);

    for (wrong, says) in [
        (
            json!({ "add": { "case": "../p01.case.toml" } }),
            "not a case file in the plan's folder",
        ),
        (
            json!({ "add": { "case": "p01.case.toml" } }),
            "not a case file in the plan's folder",
        ),
        (json!({ "remove": { "number": 3 } }), "no limb 3"),
        (
            json!({ "remove": { "number": 0, "all": true } }),
            "unknown field",
        ),
        (
            json!({ "patient": { "number": 2, "patient": 4 } }),
            "p01.case.toml is already the right limb of patient 4",
        ),
    ] {
        let answer = change(wrong);
        assert_eq!(answer.status, StatusCode::UNPROCESSABLE_ENTITY);
        assert!(answer.text().contains(says), "{}", answer.text());
    }
}

#[test]
fn the_last_limb_stays() {
    let browser = opened();
    let answer = browser.post("/api/plan/limbs", &json!({ "remove": { "number": 0 } }));
    assert_eq!(answer.status, StatusCode::UNPROCESSABLE_ENTITY);
    assert!(
        answer.text().contains("at least one limb"),
        "{}",
        answer.text()
    );
}

#[test]
fn limits_of_a_field_are_those_of_the_plan() {
    let browser = opened();
    let limits = |key: &str| {
        browser
            .post("/api/plan/limits", &json!({ "key": key }))
            .json()
    };
    let limit = |value: f64, included: bool| json!({ "value": value, "included": included });
    assert_eq!(limits("soft_tissue.distal_mm")["low"], limit(0.0, true));
    // Angles are multiples of half a degree, and steps divide the sweep.
    assert_eq!(limits("rotation.step_deg"), Value::Null);
    assert_eq!(limits("rotation.from_deg"), Value::Null);
    // Values are refused beyond a limit and accepted at it or just within.
    for key in [
        "xray.kvp",
        "xray.detector.columns",
        "positioning.tilt_deg",
        "soft_tissue.distal_mm",
    ] {
        let found = limits(key);
        for (end, sign) in [("low", -1.0), ("high", 1.0)] {
            let Some(value) = found[end]["value"].as_f64() else {
                continue;
            };
            let whole = key.ends_with("columns");
            let nearby = if whole {
                1.0
            } else {
                1e-6 * value.abs().max(1.0)
            };
            let typed = |value: f64| {
                if whole {
                    format!("{value:.0}")
                } else {
                    format!("{value:?}")
                }
            };
            let answer = set(&browser, key, json!(typed(value + sign * nearby)));
            assert_eq!(
                answer.status,
                StatusCode::UNPROCESSABLE_ENTITY,
                "{key} {found}"
            );
            let inside = if found[end]["included"] == true {
                value
            } else {
                value - sign * nearby
            };
            set(&browser, key, json!(typed(inside))).json();
            browser.post("/api/plan/undo", &json!({})).json();
        }
    }
    // A whole number at its limit has limits as well.
    set(&browser, "xray.detector.columns", json!("1")).json();
    assert_eq!(limits("xray.detector.columns")["low"], limit(1.0, true));
    assert_eq!(limits("depth.rig"), Value::Null);
    let answer = browser.post("/api/plan/limits", &json!({ "key": "case" }));
    assert_eq!(answer.status, StatusCode::UNPROCESSABLE_ENTITY);
}
