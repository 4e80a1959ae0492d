//! `ppa depth`: a camera from OpenCV's calibration, a recording through a sensor, and a fit of its noise.

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
fn fit_noise_recovers_noise_for_any_number_of_threads() {
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
    // The default is 1.14 mm; 7 700 pixels of 12 frames determine it to about 0.5 %.
    let found = fitted["random"]["at_unit_signal_mm"].as_f64().unwrap();
    assert!((found / 1.14 - 1.0).abs() < 0.03, "{found}");
    let again = "depth render wall.ply --camera camera.json --sensor fitted.json --out again.png";
    succeed(folder.path(), again);
}

#[test]
fn invalid_cameras_recordings_and_sensors_are_refused() {
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

/// A square of side 2 `half_mm` perpendicular to the camera's axis.
fn square(half_mm: f64, z_mm: f64) -> String {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let vertex = |[x, y]: [f64; 2]| format!("v {} {} {z_mm}\n", x * half_mm, y * half_mm);
    corners.map(vertex).concat() + "f 1 3 2\nf 1 4 3\n"
}

#[test]
fn depths_beyond_16_bits_are_counted_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    scene(folder);
    fs::write(folder.join("near.obj"), square(100.0, 1500.0)).unwrap();
    fs::write(folder.join("far.obj"), square(60_000.0, 70_000.0)).unwrap();
    let command = "depth render far.obj --camera camera.json --out far.png";
    let said = fail(folder, command);
    assert!(
        said.contains("far.png cannot hold depths beyond 65.535 m"),
        "{said}"
    );
    assert!(!folder.join("far.png").exists());
    let both = "depth render near.obj far.obj --camera camera.json --out both.png";
    let object: Value = serde_json::from_str(&succeed(folder, &format!("{both} --json"))).unwrap();
    assert_eq!(object["valid_pixels"], 96 * 80);
    let written = ppa_depth::DepthImage::read_png(&folder.join("both.png")).unwrap();
    let lost = 96 * 80 - written.valid_pixels();
    assert!(lost > 0 && lost < 96 * 80, "{lost}");
    assert_eq!(object["too_far_pixels"], lost);
    let again = format!("{both} --replace");
    assert!(succeed(folder, &again).contains("beyond 65.535 m"));
}

#[test]
fn a_sensor_that_measures_nothing_says_so() {
    let folder = tempfile::tempdir().unwrap();
    scene(folder.path());
    let blind = r#"{"invalid": {"min_signal": 100, "max_angle_deg": 85, "min_contrast": 0}}"#;
    fs::write(folder.path().join("blind.json"), blind).unwrap();
    let command = "depth render wall.ply --camera camera.json --sensor blind.json --out d.png";
    let said = fail(folder.path(), command);
    assert!(
        said.contains("it rejects all 7680 pixels that see a surface"),
        "{said}"
    );
    assert!(!folder.path().join("d.png").exists());
}

#[test]
fn only_three_numbers_are_a_point() {
    let folder = tempfile::tempdir().unwrap();
    let put = |text: &str| fs::write(folder.path().join("points.csv"), text).unwrap();
    for text in ["0,0,1000\n", "x, y, z\n0,0,1000\n"] {
        put(text);
        assert_eq!(
            succeed(folder.path(), "depth project points.csv")
                .lines()
                .count(),
            1
        );
    }
    for (text, part) in [
        ("0;0;1000\n", "row 1"),
        ("0,0,1000,7\n", "row 1"),
        ("x,y,z\n0,0,1000\n0,zero,1000\n", "row 3"),
        ("0,0,one\n", "row 1"),
        ("0,0,nan\n", "row 1"),
        ("x,y,z\n", "no points"),
    ] {
        put(text);
        let said = fail(folder.path(), "depth project points.csv");
        assert!(
            said.contains("points.csv") && said.contains(part),
            "{text}: {said}"
        );
    }
}

#[test]
fn a_camera_of_impossible_numbers_is_named() {
    let folder = tempfile::tempdir().unwrap();
    scene(folder.path());
    let camera = fs::read_to_string(folder.path().join("camera.json")).unwrap();
    let mut camera: Value = serde_json::from_str(&camera).unwrap();
    camera["fx"] = (-90.0).into();
    fs::write(folder.path().join("odd.json"), camera.to_string()).unwrap();
    let said = fail(
        folder.path(),
        "depth render wall.ply --camera odd.json --out d.png",
    );
    assert!(
        said.contains("odd.json") && said.contains("fx is -90"),
        "{said}"
    );
}
