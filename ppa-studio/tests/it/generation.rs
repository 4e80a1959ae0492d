//! Datasets made through the page.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use axum::http::StatusCode;
use ppa_generate::{GenerateSettings, Plan, generate};
use serde_json::{Value, json};

use crate::browser::Browser;
use crate::plans::{POSES, plan};

const PATIENCE: Duration = Duration::from_secs(300);

fn opened() -> Browser {
    let folder = tempfile::tempdir().unwrap();
    let file = plan(folder.path());
    Browser::of(folder, file)
}

fn state(browser: &Browser) -> Value {
    browser.get("/api/generation?folder=ankles").json()
}

/// Waits for a state of the dataset.
fn wait(browser: &Browser, is: impl Fn(&Value) -> bool) -> Value {
    let started = Instant::now();
    loop {
        let found = state(browser);
        if is(&found) {
            return found;
        }
        assert!(started.elapsed() < PATIENCE, "{found}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Returns all files below a folder, by path.
fn files(root: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(root).unwrap().display().to_string();
                found.insert(name, std::fs::read(&path).unwrap());
            }
        }
    }
    found
}

#[test]
fn changes_of_a_plan_that_were_removed_do_not_replace_it() {
    let browser = opened();
    let before = std::fs::read_to_string(&browser.case).unwrap();
    let change = json!({ "key": "rotation.step_deg", "value": "2.5" });
    browser.post("/api/plan/key", &change).json();
    let edited = browser.folder.path().join("ankles.edited.toml");
    std::fs::remove_file(&edited).unwrap();
    let folder = json!({ "folder": "ankles" });
    browser.post("/api/generation", &folder).json();
    browser.post("/api/generation/pause", &folder).json();
    wait(&browser, |found| found["phase"] != "stopping");
    assert_eq!(std::fs::read_to_string(&browser.case).unwrap(), before);
}

#[test]
fn a_dataset_of_the_page_is_that_of_the_library() {
    let browser = opened();
    assert_eq!(state(&browser)["phase"], "absent");
    let folder = json!({ "folder": "ankles" });
    let begun = browser.post("/api/generation", &folder).json();
    assert_eq!(begun["phase"], "running");
    let refused = browser.post("/api/generation", &folder);
    assert_eq!(refused.status, StatusCode::CONFLICT);
    assert!(refused.text().contains("is being made: pause it first"));

    // The run pauses after complete poses, with a contact sheet of the poses made.
    wait(&browser, |found| found["made"].as_u64() > Some(0));
    browser.post("/api/generation/pause", &folder).json();
    let paused = wait(&browser, |found| found["phase"] != "stopping");
    let made = paused["made"].as_u64().unwrap();
    assert_eq!(paused["limbs"], json!([{ "patient": 4, "side": "r" }]));
    assert!(made < POSES as u64, "it was too fast to be paused");
    assert_eq!(paused["phase"], "paused");
    let sheet = |browser: &Browser| {
        let answer = browser.get("/api/contact_sheet/4/r?folder=ankles");
        assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
        image::load_from_memory(&answer.body).unwrap().width()
    };
    let before = sheet(&browser);

    // Another studio continues from the files.
    let Browser { folder, case, .. } = browser;
    let browser = Browser::of(folder, case);
    assert_eq!(state(&browser)["made"], made);
    browser
        .post("/api/generation", &json!({ "folder": "ankles" }))
        .json();
    let done = wait(&browser, |found| found["phase"] == "complete");
    assert_eq!(done["made"], POSES);
    assert!(sheet(&browser) > before);

    let commands = &done["commands"]["generate"];
    let dataset = browser.folder.path().join("ankles");
    let plan_file = browser.case.display();
    assert_eq!(
        commands,
        &json!(format!(
            "ppa generate {plan_file} --out {}",
            dataset.display()
        ))
    );
    let plan = Plan::read(&browser.case).unwrap();
    let root = browser.folder.path().join("by_the_library");
    generate(&plan, &root, &GenerateSettings::default(), &|_| {}).unwrap();
    let expected = files(&root);
    assert!(expected.len() > 3 * POSES);
    assert_eq!(files(&dataset), expected);
}

#[test]
fn a_run_ends_with_the_studio_after_whole_poses() {
    let browser = opened();
    browser
        .post("/api/generation", &json!({ "folder": "ankles" }))
        .json();
    wait(&browser, |found| found["made"].as_u64() > Some(0));
    let Browser { folder, router, .. } = browser;
    drop(router);
    let root = folder.path().join("ankles");
    let status = ppa_generate::status(&root).unwrap();
    assert!(!status.running);
    assert!(status.made < POSES, "{}", status.made);
}

#[test]
fn a_plan_that_does_not_fit_the_folder_is_refused() {
    let browser = opened();
    let plan = Plan::read(&browser.case).unwrap();
    let root = browser.folder.path().join("ankles");
    let part = "1/6".parse().unwrap();
    let settings = GenerateSettings {
        part,
        ..GenerateSettings::default()
    };
    generate(&plan, &root, &settings, &|_| {}).unwrap();
    browser
        .post("/api/generation", &json!({ "folder": "ankles" }))
        .json();
    let failed = wait(&browser, |found| found["phase"] == "failed");
    let error = failed["error"].as_str().unwrap();
    assert!(error.contains("shard 1/6"), "{error}");
    assert_eq!(failed["made"], 1);
}

#[test]
fn shards_beside_the_dataset_are_listed_with_their_poses() {
    let browser = opened();
    assert_eq!(
        browser.get("/api/generation/shards?folder=ankles").json(),
        json!([])
    );
    let plan = Plan::read(&browser.case).unwrap();
    let part = "2/3".parse().unwrap();
    let settings = GenerateSettings {
        part,
        ..GenerateSettings::default()
    };
    let folder = |name: &str| browser.folder.path().join(name);
    generate(&plan, &folder("ankles_2_of_3"), &settings, &|_| {}).unwrap();
    std::fs::create_dir(folder("ankles_3_of_3")).unwrap();
    std::fs::create_dir(folder("ankles_notes")).unwrap();
    let shard = |shard: &str, poses: usize| json!({ "shard": shard, "pose_jobs": poses, "made": poses, "running": false, "complete": poses > 0 });
    let found = browser.get("/api/generation/shards?folder=ankles").json();
    assert_eq!(found, json!([shard("2/3", 2), shard("3/3", 0)]));
}

#[test]
fn a_forecast_counts_poses_time_and_disk() {
    let browser = opened();
    let found = browser
        .post("/api/forecast", &json!({ "folder": "ankles" }))
        .json();
    assert_eq!(
        (&found["units"], &found["measured"]),
        (&json!(POSES), &json!(1))
    );
    assert_eq!(found["depth_images"], 2 * POSES);
    assert!(found["cpu_hours"].as_f64() > Some(0.0) && found["bytes"].as_u64() > Some(10_000));
    assert_eq!(found["no_room"], Value::Null);
    assert!(!browser.folder.path().join("ankles").exists());
}

#[test]
fn folders_that_are_not_beside_the_plan_are_refused() {
    let browser = opened();
    let folder = browser.folder.path();
    #[cfg(unix)]
    std::os::unix::fs::symlink(std::env::temp_dir(), folder.join("link")).unwrap();
    for name in ["", ".", "..", "../x", "a/b", "/tmp/x", "link"] {
        let encoded: String = name.replace('/', "%2F");
        for answer in [
            browser.get(&format!("/api/generation?folder={encoded}")),
            browser.get(&format!("/api/generation/shards?folder={encoded}")),
            browser.get(&format!("/api/contact_sheet/4/r?folder={encoded}")),
            browser.post("/api/generation", &json!({ "folder": name })),
            browser.post("/api/forecast", &json!({ "folder": name })),
        ] {
            assert_eq!(answer.status, StatusCode::UNPROCESSABLE_ENTITY, "{name}");
            assert!(
                answer.text().contains("not the name of a folder"),
                "{}",
                answer.text()
            );
        }
    }
}
