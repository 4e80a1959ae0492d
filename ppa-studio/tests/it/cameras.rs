//! Cameras moved in the room.

use axum::http::StatusCode;
use ppa_depth::{CoverageSettings, RigSpec, false_colour};
use ppa_generate::{Case, JointInRoom, Plan, PreparedLimb, SceneSetup, VisibleLimb};
use serde_json::json;

use crate::browser::Browser;

/// The left camera 100 mm nearer to the patient's feet, the right one 30 mm farther down the beam.
const SHIFTS: [[f64; 3]; 2] = [[0.0, 100.0, 0.0], [0.0, 0.0, 30.0]];

/// Returns the rig of the plan with these shifts.
fn moved() -> RigSpec {
    let mut rig = RigSpec::default();
    for (camera, shift) in [&mut rig.left, &mut rig.right].into_iter().zip(SHIFTS) {
        for (row, by) in camera.device_from_camera.iter_mut().zip(shift) {
            row[3] += by;
        }
    }
    rig
}

fn what_if() -> serde_json::Value {
    let cameras = SHIFTS.map(|shift_mm| json!({ "shift_mm": shift_mm }));
    json!({ "angle_deg": 18.0, "cameras": cameras })
}

fn differences(a: &RigSpec, b: &RigSpec) -> f64 {
    let values = |rig: &RigSpec| {
        let both = [&rig.left, &rig.right].map(|camera| camera.device_from_camera);
        both.into_iter().flatten().flatten().collect::<Vec<f64>>()
    };
    let pairs = values(a).into_iter().zip(values(b));
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn moved_cameras_see_what_the_library_renders_from_there() {
    let browser = Browser::new();
    // First with the cameras of the plan, so that the room is cached.
    browser.post("/api/depth", &json!({ "angle_deg": 18.0 }));
    let answer = browser.post("/api/depth", &what_if());
    let shown = image::load_from_memory(&answer.body).unwrap().to_rgb8();
    let report: serde_json::Value =
        serde_json::from_slice(answer.headers["x-report"].as_bytes()).unwrap();
    let range: [f64; 2] = serde_json::from_value(report["range_mm"].clone()).unwrap();

    let mut plan = Plan::new(Vec::new());
    plan.depth.cameras = Some(moved());
    let setup = SceneSetup::of_plan(&plan).unwrap();
    let limb = PreparedLimb::of_case(&Case::read(&browser.case).unwrap()).unwrap();
    let joint = JointInRoom::new(&setup, &limb, 18_f64.to_radians(), plan.positioning).unwrap();
    let expected = joint
        .rank(&joint.rig(), &CoverageSettings::default())
        .unwrap();
    let limb = VisibleLimb::new(limb).unwrap();
    let views = limb.depth_views(&setup, &plan, 18.0, plan.seed).unwrap();
    for (view, left) in views.iter().zip([0, views[0].image.width]) {
        let image = &view.image;
        for [x, y] in [[300, 280], [350, 330], [250, 200]] {
            let z_mm = f64::from(image.z_mm[(y * image.width + x) as usize]);
            assert_eq!(shown.get_pixel(left + x, y).0, false_colour(z_mm, range));
        }
    }
    let coverage = browser.post("/api/coverage", &what_if()).json();
    let share = |place: usize| coverage["places"][place]["visible_share"].as_f64().unwrap();
    for (place, expected) in expected.places.iter().enumerate() {
        assert_eq!(coverage["places"][place]["name"], expected.name);
        assert!((share(place) - expected.coverage.visible_share).abs() < 1e-3);
    }
    let planned = browser
        .post("/api/coverage", &json!({ "angle_deg": 18.0 }))
        .json();
    assert_ne!(planned["places"], coverage["places"]);
}

#[test]
fn moved_cameras_are_saved_as_a_rig_and_in_the_plan() {
    let browser = Browser::new();
    let body = json!({ "what_if": what_if() });
    let saved = browser.post("/api/cameras", &body);
    assert_eq!(saved.status, StatusCode::OK, "{}", saved.text());
    let file = browser.case.with_file_name("p01.studio.rig.json");
    assert_eq!(saved.json()["file"], file.to_str().unwrap());
    assert!(differences(&RigSpec::read(&file).unwrap(), &moved()) < 1e-9);
    let again = browser.post("/api/cameras", &body);
    assert_eq!(again.status, StatusCode::CONFLICT);

    let saved = browser.post("/api/plan", &body).json();
    let plan = Plan::read(saved["file"].as_str().unwrap().as_ref()).unwrap();
    assert!(differences(&plan.depth.cameras.unwrap(), &moved()) < 1e-9);
    let commands = browser.post("/api/commands", &what_if()).json();
    assert_eq!(commands["need_saved_plan"], true);
    let coverage = commands["coverage"].as_str().unwrap();
    assert!(coverage.starts_with("ppa depth coverage "), "{coverage}");

    let far = json!({ "cameras": [{ "shift_mm": [9e9, 0.0, 0.0] }, {}] });
    let refused = browser.post("/api/depth", &far);
    assert_eq!(refused.status, StatusCode::UNPROCESSABLE_ENTITY);
    assert!(refused.text().contains("3000 mm"), "{}", refused.text());
}
