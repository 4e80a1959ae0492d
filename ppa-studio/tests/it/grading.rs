//! Grading by readers: meaningless names, saved grades, and labels from them.

use std::path::Path;

use axum::http::StatusCode;
use image::{ColorType, GenericImageView};
use ppa_dataset::Manifest;
use ppa_dataset::labels::LabelFile;
use ppa_label::{import_grades, read_key};
use serde_json::{Value, json};

use crate::browser::{Browser, copy};
use crate::plans::{LIMB, dataset};

fn opened() -> Browser {
    let folder = tempfile::tempdir().unwrap();
    let root = dataset(folder.path());
    Browser::of(folder, root)
}

fn begin(reader: &str) -> Value {
    json!({ "folder": "ankles", "readers": "graded", "reader": reader, "every_deg": 0.5, "seed": 3 })
}

fn grade(image: &Value, reader: &str, grade: f64) -> Value {
    json!({ "folder": "ankles", "readers": "graded", "reader": reader, "image": image, "grade": grade })
}

fn picture(browser: &Browser, name: &str) -> crate::browser::Answer {
    browser.get(&format!(
        "/api/grading/picture/{name}?folder=ankles&readers=graded"
    ))
}

/// Returns the types of a PNG's chunks.
fn chunks(png: &[u8]) -> Vec<[u8; 4]> {
    let mut kinds = Vec::new();
    let mut rest = &png[8..];
    while let [a, b, c, d, kind @ ..] = rest {
        let length = u32::from_be_bytes([*a, *b, *c, *d]) as usize;
        kinds.push(kind[..4].try_into().unwrap());
        rest = &kind[4 + length + 4..];
    }
    kinds
}

#[test]
fn readers_get_pictures_without_a_trace_of_the_pose() {
    let browser = opened();
    let answer = browser.post("/api/grading", &begin("Anna"));
    let found = answer.json();
    let key = read_key(&browser.folder.path().join("graded.key.csv")).unwrap();
    // 11 radiographs, two of them twice.
    assert_eq!(key.len(), 13);
    let names: Vec<&str> = key.iter().map(|case| case.name.as_str()).collect();
    assert_eq!(found["pictures"], json!(names));
    for case in &key {
        let traces = [&case.image, &case.sha256];
        assert!(!traces.iter().any(|trace| answer.text().contains(*trace)));
        let png = picture(&browser, &case.name);
        assert_eq!(png.status, StatusCode::OK);
        let shown = image::load_from_memory(&png.body).unwrap();
        assert_eq!(shown.color(), ColorType::L8);
        let original = image::open(browser.case.join(&case.image)).unwrap();
        let (narrow, wide) = (shown.to_luma8(), original.to_luma16());
        assert_eq!(shown.dimensions(), original.dimensions());
        assert!(
            narrow
                .pixels()
                .zip(wide.pixels())
                .all(|(a, b)| u16::from(a.0[0]) == b.0[0] >> 8)
        );
        let allowed = [b"IHDR", b"IDAT", b"IEND"];
        assert!(chunks(&png.body).iter().all(|kind| allowed.contains(&kind)));
    }
}

#[test]
fn a_grade_is_saved_at_once_and_found_again() {
    let browser = opened();
    let found = browser.post("/api/grading", &begin("Anna")).json();
    assert_eq!(found["key_found"], false);
    assert_eq!(found["grades"], json!({}));
    let [first, second] = [0, 4].map(|n| found["pictures"][n].clone());
    for (image, given) in [(&second, 3.0), (&first, 1.5), (&second, 2.5)] {
        browser
            .post("/api/grading/grade", &grade(image, "Anna", given))
            .json();
    }
    let file = browser.folder.path().join("graded/grades_Anna.csv");
    assert_eq!(found["file"], json!(file));
    let text = std::fs::read_to_string(&file).unwrap();
    let [a, b] = [&first, &second].map(|name| name.as_str().unwrap());
    assert_eq!(
        text,
        format!("image,reader,grade\n{a},Anna,1.5\n{b},Anna,2.5\n")
    );
    // The existing key is used, whatever seed the page sends.
    let mut again = begin("Anna");
    again["seed"] = json!(4);
    let again = browser.post("/api/grading", &again).json();
    assert_eq!(again["key_found"], true);
    assert_eq!(again["pictures"], found["pictures"]);
    assert_eq!(again["grades"], json!({ a: 1.5, b: 2.5 }));
    let other = browser.post("/api/grading", &begin("Ben")).json();
    assert_eq!(other["grades"], json!({}));
}

#[test]
fn a_dataset_not_made_yet_is_refused_for_grading() {
    let folder = tempfile::tempdir().unwrap();
    let file = crate::plans::plan(folder.path());
    let browser = Browser::opened(folder, &ppa_studio::Opening::of(&file));
    let refused = browser.post("/api/grading", &begin("Anna"));
    assert_eq!(refused.status, StatusCode::UNPROCESSABLE_ENTITY);
    let text = refused.text();
    assert!(text.contains("ankles is not a complete dataset"), "{text}");
    assert!(!browser.folder.path().join("graded.key.csv").exists());
}

#[test]
fn grades_of_all_readers_become_labels() {
    let browser = opened();
    let twin = tempfile::tempdir().unwrap();
    copy(browser.folder.path(), twin.path());
    for (reader, given) in [("Anna", 1.0), ("Ben", 2.0)] {
        let found = browser.post("/api/grading", &begin(reader)).json();
        for image in found["pictures"].as_array().unwrap() {
            browser
                .post("/api/grading/grade", &grade(image, reader, given))
                .json();
        }
    }
    let place = json!({ "folder": "ankles", "readers": "graded" });
    let done = browser.post("/api/grading/import", &place).json();
    assert_eq!(
        [&done["readers"], &done["labelled"], &done["repeats"]],
        [&json!(2), &json!(11), &json!(4)]
    );
    let quality = browser.get("/api/dataset?folder=ankles").json();
    assert_eq!(quality["poses"][0]["label"]["label"], 1.5);
    assert_eq!(quality["poses"][0]["label"]["source"], "readers");
    // The command writes the same files.
    let here = browser.folder.path();
    let key = read_key(&here.join("graded.key.csv")).unwrap();
    let sheets = ["Anna", "Ben"].map(|reader| here.join(format!("graded/grades_{reader}.csv")));
    let manifest = Manifest::read(&twin.path().join("ankles")).unwrap();
    import_grades(&manifest, &key, &sheets).unwrap();
    let files = |folder: &Path| {
        let root = folder.join("ankles");
        [LabelFile::path(&root, LIMB), root.join("grades.csv")]
            .map(|file| std::fs::read(file).unwrap())
    };
    assert!(files(here) == files(twin.path()));
}

#[test]
fn what_cannot_be_graded_is_refused_in_a_sentence() {
    let browser = opened();
    let here = browser.folder.path();
    std::os::unix::fs::symlink("/", here.join("linked")).unwrap();
    let refused = |body: &Value, part: &str| {
        let answer = browser.post("/api/grading", body);
        assert_eq!(answer.status, StatusCode::UNPROCESSABLE_ENTITY);
        assert!(answer.text().contains(part), "{}", answer.text());
    };
    for (key, value, part) in [
        ("readers", json!("../out"), "not the name of a folder"),
        ("readers", json!("ankles"), "is the dataset itself"),
        ("readers", json!(""), "not the name of a folder"),
        ("readers", json!("graded/"), "not the name of a folder"),
        ("readers", json!("graded/."), "not the name of a folder"),
        ("readers", json!("linked"), "not the name of a folder"),
        ("folder", json!("ankles/.."), "not the name of a folder"),
        ("reader", json!("=1+1"), "the reader's name is"),
        ("every_deg", json!(0.7), "0.7 degrees"),
    ] {
        let mut body = begin("Anna");
        body[key] = value;
        refused(&body, part);
    }
    assert!(!browser.folder.path().join("graded.key.csv").exists());

    let found = browser.post("/api/grading", &begin("Anna")).json();
    let first = &found["pictures"][0];
    for (body, part) in [
        (grade(first, "Anna", 1.2), "a grade is 1.2"),
        (
            grade(&json!("0123456789"), "Anna", 1.0),
            "not a picture in the key",
        ),
    ] {
        let answer = browser.post("/api/grading/grade", &body);
        assert_eq!(answer.status, StatusCode::UNPROCESSABLE_ENTITY);
        assert!(answer.text().contains(part), "{}", answer.text());
    }
    assert!(!here.join("graded").exists());
    std::fs::create_dir(here.join("graded")).unwrap();
    let place = json!({ "folder": "ankles", "readers": "graded" });
    let answer = browser.post("/api/grading/import", &place);
    assert!(answer.text().contains("there are no grades"));
    assert!(!browser.case.join("grades.csv").exists());

    // A radiograph that changed under its reader is not shown.
    let key = read_key(&browser.folder.path().join("graded.key.csv")).unwrap();
    let radiograph = browser.case.join(&key[0].image);
    image::GrayImage::new(4, 4).save(&radiograph).unwrap();
    let answer = picture(&browser, &key[0].name);
    assert!(
        answer.text().contains("has changed since the dataset"),
        "{}",
        answer.text()
    );
}
