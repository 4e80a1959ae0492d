//! `ppa depth`: a camera from OpenCV's calibration, a recording through a sensor, and its noise found again.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::{fail, names, succeed};

/// A wall at 1.5 m in front of a camera of 96 x 80 pixels, calibrated by OpenCV.
fn scene(folder: &Path) {
    let wall = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                element face 2\nproperty list uchar int vertex_indices\nend_header\n\
                -3000 -3000 1500\n3000 -3000 1500\n3000 3000 1500\n-3000 3000 1500\n3 0 2 1\n3 0 3 2\n";
    let calibration = "%YAML:1.0\n---\nimage_width: 96\nimage_height: 80\n\
                       camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   \
                       data: [ 90., 0., 47.5, 0., 90., 39.5, 0., 0., 1. ]\n\
                       distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   \
                       data: [ 0., 0., 0., 0., 0. ]\n";
    fs::write(folder.join("wall.ply"), wall).unwrap();
    fs::write(folder.join("camera.yml"), calibration).unwrap();
    succeed(folder, "depth camera camera.yml --out camera.json");
}

#[test]
fn the_noise_of_a_recording_is_found_again_and_is_the_same_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    scene(folder.path());
    let record = |frames: &str, options: &str| {
        fs::create_dir(folder.path().join(frames)).unwrap();
        let render =
            "depth render wall.ply --camera camera.json --sensor default --frames 12 --seed 4";
        succeed(
            folder.path(),
            &format!("{render} {options} --out {frames}/w.png"),
        );
    };
    record("one", "--threads 1");
    record("two", "--threads 2");
    let frames = names(&folder.path().join("one"));
    assert_eq!(frames.len(), 12);
    for frame in &frames {
        let [one, two] =
            ["one", "two"].map(|run| fs::read(folder.path().join(run).join(frame)).unwrap());
        assert!(one == two, "{frame}");
    }

    let fit = "depth fit-noise one --camera camera.json --out fitted.json --json";
    let fitted: Value = serde_json::from_str(&succeed(folder.path(), fit)).unwrap();
    // The default's 1.14 mm; 7 700 pixels of 12 frames tell it to about 0.5 %.
    let found = fitted["random"]["at_unit_signal_mm"].as_f64().unwrap();
    assert!((found / 1.14 - 1.0).abs() < 0.03, "{found}");
    let again = "depth render wall.ply --camera camera.json --sensor fitted.json --out again.png";
    succeed(folder.path(), again);
}

#[test]
fn what_is_no_camera_recording_or_sensor_is_refused_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    scene(folder.path());
    fs::create_dir(folder.path().join("empty")).unwrap();
    fs::write(
        folder.path().join("odd.json"),
        "{\"random\": {\"floor_mm\": -1}}",
    )
    .unwrap();
    for (arguments, named) in [
        ("depth camera wall.ply --out no.json", "wall.ply"),
        ("depth fit-noise empty --out no.json", "empty"),
        (
            "depth render wall.ply --sensor odd.json --out no.png",
            "odd.json",
        ),
        (
            "depth render wall.ply --tremor-mm nan --out no.png",
            "tremor.shift_mm is NaN",
        ),
        (
            "depth render wall.ply --camera camera.yml --out no.png",
            "ppa depth camera",
        ),
        (
            "depth render wall.ply --sensor missing.json --out no.png",
            "missing.json",
        ),
    ] {
        let said = fail(folder.path(), arguments);
        assert!(said.contains(named), "{arguments}: {said}");
    }
    assert!(
        !names(folder.path())
            .iter()
            .any(|name| name.starts_with("no."))
    );
}
