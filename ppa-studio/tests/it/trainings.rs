//! Training runs over HTTP: list, logs, errors and images.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use axum::http::StatusCode;
use ppa_learn::data::Images;
use ppa_learn::evaluate::{Evaluation, Row};
use ppa_learn::train::{predict, samples, trained};
use ppa_studio::Opening;
use serde_json::{Value, json};

use crate::browser::{Browser, phantom};
use crate::networks::networks;

/// Writes the training runs of both cameras' networks, and a stopped run.
pub fn folder_of_trainings(folder: &Path) {
    let networks = networks();
    for (name, run) in [("left", networks.left), ("right", networks.right.unwrap())] {
        let copy = folder.join("runs").join(name);
        fs::create_dir_all(&copy).unwrap();
        for file in ["config.toml", "log.jsonl", "weights.safetensors"] {
            fs::copy(run.join(file), copy.join(file)).unwrap();
        }
    }
    let stopped = folder.join("runs/later/stopped");
    fs::create_dir_all(&stopped).unwrap();
    fs::copy(
        folder.join("runs/left/config.toml"),
        stopped.join("config.toml"),
    )
    .unwrap();
    let row = r#"{"step":1,"seconds":0.5,"training/loss":0.25,"evaluation/mae":null}"#;
    fs::write(stopped.join("log.jsonl"), format!("{row}\n{{\"step\":")).unwrap();
}

fn opened() -> Browser {
    let folder = tempfile::tempdir().unwrap();
    folder_of_trainings(folder.path());
    let runs = folder.path().join("runs");
    Browser::opened(folder, &Opening::of(&runs))
}

#[test]
fn a_folder_of_trainings_is_listed_with_the_state_of_each() {
    let browser = opened();
    assert_eq!(
        browser.get("/api/opened").json(),
        json!({"limb": false, "plan": false, "dataset": null, "watched": null})
    );
    let list = browser.get("/api/trainings").json();
    let trainings = list["trainings"].as_array().unwrap();
    let names: Vec<&Value> = trainings.iter().map(|one| &one["name"]).collect();
    assert_eq!(names, ["later/stopped", "left", "right"]);
    let [stopped, left, _] = &trainings[..] else {
        panic!("{list}")
    };
    assert_eq!(
        (&stopped["finished"], &stopped["step"]),
        (&json!(false), &json!(1))
    );
    assert_eq!(
        stopped["last"],
        json!({"training/loss": 0.25, "evaluation/mae": null})
    );
    assert_eq!(
        (&left["finished"], &left["steps"]),
        (&json!(true), &json!(1))
    );
    assert!(left["command"].as_str().unwrap().starts_with("ppa eval "));
    let log = browser.get("/api/training/log?run=later/stopped").json();
    assert_eq!(log[0]["training/loss"], 0.25);
    assert_eq!(log.as_array().unwrap().len(), 1);
}

#[test]
fn errors_are_those_of_the_library_and_show_their_images() {
    let browser = opened();
    let run = networks().left;
    let (config, network) = trained(&run).unwrap();
    let tested = samples(&config, &config.evaluation).unwrap();
    let images = Arc::new(Images::new(tested, config.side, 0).unwrap());
    let said = predict(&network, &images, config.batch_size, config.workers).unwrap();
    let mut rows = Row::of(images.samples(), &said);
    let expected = Evaluation::of(&rows).unwrap();

    let errors = browser
        .post("/api/training/errors", &json!({ "run": "left" }))
        .json();
    assert_eq!(errors["evaluation"], json!(expected));
    rows.sort_by(|a, b| {
        let error = |row: &Row| (row.prediction - row.label).abs();
        error(b).total_cmp(&error(a))
    });
    rows.truncate(12);
    assert_eq!(errors["worst"], json!(rows));
    let image = browser.get("/api/training/image/0?run=left");
    let picture = image::load_from_memory(&image.body).unwrap();
    assert_eq!((picture.width(), picture.height()), (50, 50));
}

#[test]
fn what_is_no_training_to_show_is_refused() {
    let browser = opened();
    let refused = |answer: crate::browser::Answer, expected: &str| {
        assert_eq!(answer.status, StatusCode::UNPROCESSABLE_ENTITY);
        assert!(answer.text().contains(expected), "{}", answer.text());
    };
    let errors = |run: &str| browser.post("/api/training/errors", &json!({ "run": run }));
    refused(errors("later/stopped"), "not finished");
    let outside = networks().left;
    refused(errors(outside.to_str().unwrap()), "no training is named");
    refused(
        browser.get("/api/training/log?run=/etc"),
        "no training is named",
    );
    refused(browser.get("/api/training/image/0?run=right"), "no error 0");
    // There is no limb.
    refused(browser.get("/api/state"), "no limb is open");
    refused(browser.get("/api/plan/form"), "no limb is open");
}

#[test]
fn trainings_beside_a_case_are_listed() {
    let folder = tempfile::tempdir().unwrap();
    let case = phantom(folder.path());
    folder_of_trainings(folder.path());
    fs::rename(
        folder.path().join("runs/left"),
        folder.path().join("beside"),
    )
    .unwrap();
    let browser = Browser::of(folder, case);
    let list = browser.get("/api/trainings").json();
    assert_eq!(list["trainings"].as_array().unwrap().len(), 1);
    assert_eq!(list["trainings"][0]["name"], "beside");
}
