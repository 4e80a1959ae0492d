//! Predictions of networks for frames as a recorder writes them.

use std::fs;
use std::path::Path;
use std::time::{Duration, SystemTime};

use axum::http::StatusCode;
use ppa_core::{Roi, Side};
use ppa_learn::DeviceName;
use ppa_learn::frames::PairPredictor;
use ppa_studio::{Opening, Studio, Watch};
use serde_json::{Value, json};

use crate::browser::Browser;
use crate::networks::networks;

const REGIONS: [Roi; 2] = [
    Roi {
        x_start: 1,
        y_start: 2,
        size: 40,
    },
    Roi {
        x_start: 5,
        y_start: 3,
        size: 41,
    },
];

/// Opens the watch of a folder's frames.
pub fn watching(folder: &Path) -> Opening {
    let frames = folder.join("frames");
    fs::create_dir(&frames).unwrap();
    Opening {
        networks: Some(networks()),
        watch: Some(Watch {
            folder: frames,
            regions: REGIONS,
            side: Some(Side::Left),
        }),
        ..Opening::default()
    }
}

/// Writes the frames of both cameras, with depths shifted by `seed` mm.
pub fn write_frames(folder: &Path, name: &str, seed: u16) {
    for (camera, offset) in [("left", 0), ("right", 40)] {
        let value = |x: u32, y: u32| image::Luma([700 + seed + offset + (x * y % 300) as u16]);
        let frame = image::ImageBuffer::from_fn(50, 50, value);
        let file = folder.join(format!("frames/depth_cam_{camera}_{name}.png"));
        frame.save(file).unwrap();
    }
}

fn report(answer: &crate::browser::Answer) -> Value {
    assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
    serde_json::from_slice(answer.headers["x-report"].as_bytes()).unwrap()
}

#[test]
fn the_newest_frames_are_judged_as_by_predict() {
    let folder = tempfile::tempdir().unwrap();
    let opening = watching(folder.path());
    let browser = Browser::opened(folder, &opening);
    let frames = browser.folder.path();
    assert_eq!(browser.get("/api/live/0").status, StatusCode::NO_CONTENT);
    write_frames(frames, "first", 0);
    write_frames(frames, "second", 90);
    let answer = browser.get("/api/live/0");
    let shown = report(&answer);
    assert_eq!(
        (&shown["name"], &shown["number"]),
        (&json!("second"), &json!(2))
    );
    let picture = image::load_from_memory(&answer.body).unwrap().to_rgb8();
    assert_eq!(picture.dimensions(), (100, 50));
    for [x, y] in [[1, 2], [40, 41], [55, 3], [95, 43]] {
        assert_eq!(picture.get_pixel(x, y).0, [255; 3], "{x}, {y}");
    }
    let networks = networks();
    let (left, right) = (&networks.left, networks.right.as_deref());
    let cpu = DeviceName::Cpu;
    let predictor = PairPredictor::new(left, right, REGIONS, Some(Side::Left), cpu).unwrap();
    let file = |camera| frames.join(format!("frames/depth_cam_{camera}_second.png"));
    let expected = predictor.predict([&file("left"), &file("right")]).unwrap();
    assert_eq!(shown["answer"]["prediction"], json!(expected));
    let age = |shown: &Value| shown["age_s"].as_f64().unwrap();
    assert!((0.0..600.0).contains(&age(&shown)), "{shown}");
    // There is nothing newer; a page opened later sees the same pair.
    assert_eq!(browser.get("/api/live/2").status, StatusCode::NO_CONTENT);
    assert_eq!(report(&browser.get("/api/live/0"))["number"], 2);
    // Frames written an hour ago have that age, however soon the prediction follows.
    write_frames(frames, "third", 0);
    for camera in ["left", "right"] {
        let file = frames.join(format!("frames/depth_cam_{camera}_third.png"));
        let file = fs::File::options().write(true).open(file).unwrap();
        let earlier = SystemTime::now() - Duration::from_secs(3600);
        file.set_modified(earlier).unwrap();
    }
    assert!(age(&report(&browser.get("/api/live/2"))) > 3599.0);
}

#[test]
fn damaged_frames_are_refused_and_the_next_ones_judged() {
    let folder = tempfile::tempdir().unwrap();
    let opening = watching(folder.path());
    let browser = Browser::opened(folder, &opening);
    let frames = browser.folder.path();
    write_frames(frames, "a", 0);
    let file = frames.join("frames/depth_cam_right_a.png");
    let whole = fs::read(&file).unwrap();
    let damaged = [&whole[..whole.len() / 2], &whole[whole.len() - 12..]].concat();
    fs::write(&file, damaged).unwrap();
    let answer = browser.get("/api/live/0");
    assert!(answer.body.is_empty());
    let refused = report(&answer)["answer"]["refused"]
        .as_str()
        .unwrap()
        .to_owned();
    assert!(refused.contains("depth_cam_right_a.png"), "{refused}");
    write_frames(frames, "b", 0);
    let shown = report(&browser.get("/api/live/1"));
    assert_eq!((&shown["name"], &shown["number"]), (&json!("b"), &json!(2)));
    assert!(shown["answer"]["prediction"]["quality"].is_f64());
}

#[test]
fn a_watch_that_cannot_work_is_refused_when_opened() {
    let folder = tempfile::tempdir().unwrap();
    let opening = watching(folder.path());
    let watch = opening.watch.clone().unwrap();
    let refused = |opening: Opening, expected: &str| {
        let Err(error) = Studio::open(&opening) else {
            panic!("opened")
        };
        assert!(error.to_string().contains(expected), "{error}");
    };
    let without = Opening {
        networks: None,
        ..opening.clone()
    };
    refused(without, "no networks");
    let side = Watch {
        side: None,
        ..watch.clone()
    };
    refused(
        Opening {
            watch: Some(side),
            ..opening.clone()
        },
        "left or a right limb",
    );
    let gone = Watch {
        folder: folder.path().join("gone"),
        ..watch
    };
    refused(
        Opening {
            watch: Some(gone),
            ..opening
        },
        "gone",
    );
}
