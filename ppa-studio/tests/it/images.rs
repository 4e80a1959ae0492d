//! Slices, skin, depth images and radiographs.

use axum::http::StatusCode;
use image::GenericImageView;
use ppa_depth::false_colour;
use ppa_generate::{Case, GenerateSettings, Plan, PreparedLimb, SceneSetup, VisibleLimb, generate};
use ppa_studio::Opening;
use serde_json::json;

use crate::browser::{Answer, Browser, fine_phantom};

fn picture(answer: &Answer) -> image::DynamicImage {
    assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
    image::load_from_memory(&answer.body).unwrap()
}

#[test]
fn a_slice_holds_the_voxels_of_the_scan_and_the_limb() {
    let browser = Browser::new();
    let limb = PreparedLimb::of_case(&Case::read(&browser.case).unwrap()).unwrap();
    let grid = limb.volume.grid();
    let [ni, nj, nk] = grid.size();
    for (axis, index, columns, rows) in [(2, nk / 2, ni, nj), (1, nj / 2, ni, nk), (0, 3, nj, nk)] {
        let slice = browser.get(&format!("/api/slice/{axis}/{index}"));
        assert_eq!(slice.body.len(), 3 * columns * rows);
        for (column, row) in [(0, 0), (columns - 1, 0), (columns / 2, rows / 2)] {
            let voxel = match axis {
                0 => [index, column, row],
                1 => [column, index, row],
                _ => [column, row, index],
            };
            let at = row * columns + column;
            let hu = i16::from_le_bytes([slice.body[2 * at], slice.body[2 * at + 1]]);
            assert_eq!(f32::from(hu), limb.volume.at(voxel));
            let inside = slice.body[2 * columns * rows + at] == 1;
            assert_eq!(inside, limb.limb.mask[grid.index(voxel)]);
        }
    }
    let outside = browser.get(&format!("/api/slice/2/{nk}"));
    assert_eq!(outside.status, StatusCode::UNPROCESSABLE_ENTITY);
    assert!(outside.text().contains("outside the scan"));
}

/// Counts of vertices and triangles, positions, normals and corners, then how far each vertex moved outwards.
#[test]
fn body_shapes_are_shown_with_their_distance_from_the_scan() {
    let browser = Browser::new();
    let outwards = |shape: &str| {
        let body = browser
            .post("/api/body_shape", &json!({ "shape": shape }))
            .body;
        let [vertices, triangles] =
            [0, 4].map(|at| u32::from_le_bytes(body[at..at + 4].try_into().unwrap()) as usize);
        let values = &body[8 + 24 * vertices + 12 * triangles..];
        assert_eq!(values.len(), 4 * vertices);
        let values = values.chunks(4);
        values
            .map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap()))
            .collect::<Vec<f32>>()
    };
    let within = |values: &[f32], low: f32, high: f32| {
        let inside = values.iter().filter(|mm| (low..=high).contains(*mm));
        inside.count() as f64 / values.len() as f64
    };
    // The plan's default moves the skin by 4 mm.
    assert!(within(&outwards("big"), 3.5, 4.01) > 0.95);
    assert!(within(&outwards("small"), -4.01, -3.5) > 0.95);
    assert_eq!(within(&outwards("orig"), 0.0, 0.0), 1.0);
    let bumps = outwards("bumps_a");
    assert!(within(&bumps, -0.1, 0.1) > 0.5 && within(&bumps, 2.0, 30.0) > 0.005);
}

#[test]
fn depth_images_are_those_of_the_library_in_false_colour() {
    let browser = Browser::new();
    let answer = browser.post(
        "/api/depth",
        &json!({ "angle_deg": 18.0, "distal_mm": 2.0, "tilt_deg": 4.0, "beam_across_mm": -15.0 }),
    );
    let shown = picture(&answer);
    let mut plan = Plan::new(Vec::new());
    plan.soft_tissue.distal_mm = 2.0;
    plan.positioning.tilt_deg = 4.0;
    plan.positioning.beam_shift_mm = [-15.0, 0.0];
    let setup = SceneSetup::of_plan(&plan).unwrap();
    let limb = PreparedLimb::of_case(&Case::read(&browser.case).unwrap()).unwrap();
    let limb = VisibleLimb::new(limb).unwrap();
    let views = limb.depth_views(&setup, &plan, 18.0, plan.seed).unwrap();
    let [left, right] = &views[..] else { panic!() };
    assert_eq!(shown.width(), left.image.width + right.image.width);
    let report: serde_json::Value =
        serde_json::from_slice(answer.headers["x-report"].as_bytes()).unwrap();
    let range: [f64; 2] = serde_json::from_value(report["range_mm"].clone()).unwrap();
    for (x, y) in [(300, 280), (320, 300), (1000, 250)] {
        let (view, column) = if x < left.image.width {
            (left, x)
        } else {
            (right, x - left.image.width)
        };
        let z_mm = view.image.z_mm[(y * view.image.width + column) as usize];
        assert_eq!(
            shown.get_pixel(x, y).0[..3],
            false_colour(f64::from(z_mm), range)
        );
    }
}

#[test]
fn of_many_depth_requests_at_once_few_are_computed() {
    let browser = Browser::new();
    let requests = (0..100).map(|angle| {
        let what_if = json!({ "angle_deg": angle });
        browser.posting("/api/depth", what_if.to_string())
    });
    let answers = browser.send_all(requests.collect());
    let count = |status| answers.iter().filter(|a| a.status == status).count();
    // The newest, and those that began before the next one arrived.
    assert!((1..20).contains(&count(StatusCode::OK)));
    assert_eq!(count(StatusCode::OK) + count(StatusCode::CONFLICT), 100);
    let next = browser.post("/api/depth", &json!({ "angle_deg": 3.0 }));
    assert_eq!(next.status, StatusCode::OK);
}

#[test]
fn a_radiograph_is_first_coarse_and_then_whole() {
    let browser = Browser::new();
    let what_if = json!({ "angle_deg": 18.0, "mas": 4.0 });
    let first = picture(&browser.post("/api/radiograph/first", &what_if));
    assert!(first.width() < 200);
    let last = browser.post("/api/radiograph/final", &what_if);
    assert_eq!(picture(&last).dimensions(), (448, 448));
    let report = last.headers["x-report"].to_str().unwrap();
    assert!(report.contains("\"mas\":4.0"), "{report}");
    assert!(report.contains("\"entrance_air_kerma_ugy\":"), "{report}");
    assert_eq!(
        browser.post("/api/radiograph/best", &what_if).status,
        StatusCode::NOT_FOUND
    );
}

#[test]
fn a_radiograph_with_shifted_beam_is_that_of_a_new_studio() {
    let shifted = json!({ "angle_deg": 18.0, "beam_along_mm": 60.0 });
    let browser = Browser::new();
    let centred = browser.post("/api/radiograph/first", &json!({ "angle_deg": 18.0 }));
    let later = browser.post("/api/radiograph/first", &shifted);
    let at_once = Browser::new().post("/api/radiograph/first", &shifted);
    assert!(later.body == at_once.body && later.body != centred.body);
}

#[test]
fn only_a_later_radiograph_ends_the_one_under_way() {
    let browser = Browser::new();
    let statuses = |paths: [&str; 2]| {
        let what_if = json!({ "angle_deg": 18.0 }).to_string();
        let requests = paths.map(|path| browser.posting(path, what_if.clone()));
        let answers = browser.send_all(requests.into());
        answers.iter().map(|a| a.status).collect::<Vec<_>>()
    };
    let (ok, ended) = (StatusCode::OK, StatusCode::CONFLICT);
    let [first, last] = ["/api/radiograph/first", "/api/radiograph/final"];
    assert_eq!(statuses([last, first]), [ended, ok]);
    assert_eq!(statuses(["/api/dose", first]), [ended, ok]);
    // Depth images of this pose may arrive late if the previous ones took long.
    assert_eq!(statuses([first, "/api/depth"]), [ok, ok]);
}

#[test]
fn bone_absorbs_more_per_gram_than_soft_tissue() {
    let browser = Browser::new();
    let dose = browser
        .post("/api/dose", &json!({ "angle_deg": 18.0 }))
        .json();
    assert_eq!(dose["histories"], 2_000_000);
    let matter = dose["matter"].as_array().unwrap();
    let of = |name: &str| {
        let found = matter.iter().find(|of| of["name"] == name);
        let found = found.unwrap_or_else(|| panic!("no {name} in {matter:?}"));
        let [value, se] = ["gy_per_history", "gy_per_history_se"].map(|key| found[key].as_f64());
        let (value, se) = (value.unwrap(), se.unwrap());
        assert!(se > 0.0 && se < 0.02 * value, "{name}: {value} ± {se}");
        value
    };
    let (muscle, bone) = (of("muscle"), of("bone"));
    // At 60 kV bone has 3 to 5 times the mass energy absorption of muscle, and lies deeper.
    assert!(bone > 1.5 * muscle, "{bone}, {muscle}");
    let all = of("all voxels");
    assert!(muscle < all && all < bone, "{all}");
    assert!(!matter.iter().any(|of| of["name"] == "air"));
}

#[test]
fn commands_name_the_files_and_options_of_the_page() {
    let browser = Browser::new();
    let what_if = json!({ "angle_deg": 18.5, "kvp": 55.0, "filters": ["Al:3"], "mas": 4.0 });
    let commands = browser.post("/api/commands", &what_if).json();
    let radiograph = commands["radiograph"].as_str().unwrap();
    assert!(radiograph.starts_with("ppa xray simulate "));
    assert!(
        radiograph.contains("--angle 18.5 --kvp 55 --filter Al:3 --mas 4 --out radiograph.png")
    );
    assert_eq!(commands["need_saved_plan"], false);
    let state = browser.get("/api/state").json();
    let prepare = state["commands"]["prepare"].as_str().unwrap();
    assert!(prepare.contains("p01.nii --side r --bones "), "{prepare}");
    // No option removes filters.
    let bare = browser.post("/api/commands", &json!({ "filters": [] }));
    assert_eq!(bare.json()["need_saved_plan"], true);
    let commands = browser
        .post("/api/commands", &json!({ "distal_mm": 2.0 }))
        .json();
    assert_eq!(commands["need_saved_plan"], true);
    assert!(
        commands["depth"]
            .as_str()
            .unwrap()
            .contains("p01.studio.plan.toml")
    );
}

#[test]
fn the_label_of_a_pose_follows_its_rotation() {
    // Gutters need finer voxels.
    let folder = tempfile::tempdir().unwrap();
    let case = fine_phantom(folder.path());
    let browser = Browser::of(folder, case);
    let label = |angle_deg: f64| {
        let label = browser.post("/api/label", &json!({ "angle_deg": angle_deg }));
        label.json()["label"].as_f64().unwrap()
    };
    // The mortise view of P01 is at 18 degrees.
    assert!(label(18.0) < 2.5);
    assert_eq!(label(70.0), 3.0);
    let mut case = Case::read(&browser.case).unwrap();
    case.bones = None;
    case.write(&browser.case).unwrap();
    let Browser { folder, case, .. } = browser;
    let without_bones = Browser::of(folder, case);
    let label = without_bones.post("/api/label", &json!({ "angle_deg": 18.0 }));
    assert_eq!(label.json(), serde_json::Value::Null);
}

#[test]
fn a_surface_at_another_hu_shows_all_of_the_scan() {
    let browser = Browser::new();
    let vertices = |hu: f64| {
        let surface = browser.post("/api/surface_at", &json!({ "iso_hu": hu }));
        assert_eq!(surface.status, StatusCode::OK, "{}", surface.text());
        let count =
            |at: usize| u32::from_le_bytes(surface.body[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!(surface.body.len(), 8 + 24 * count(0) + 12 * count(4));
        count(0)
    };
    assert!(vertices(300.0) > 1000 && vertices(-500.0) > 1000);
    let refused = browser.post("/api/surface_at", &json!({ "iso_hu": 9000.0 }));
    assert_eq!(refused.status, StatusCode::UNPROCESSABLE_ENTITY);
}

#[test]
fn nothing_is_shown_as_removed_where_nothing_was() {
    let browser = Browser::new();
    let removed = browser.get("/api/removed");
    assert_eq!(removed.status, StatusCode::OK, "{}", removed.text());
    assert_eq!(removed.body[..], [0; 8]);
}

#[test]
fn a_body_shape_is_that_of_the_plans_dataset() {
    let folder = tempfile::tempdir().unwrap();
    let file = crate::plans::plan(folder.path());
    let text = std::fs::read_to_string(&file).unwrap();
    let text = text.replace("[\"orig\"]", "[\"orig\", \"bumps_b\"]");
    std::fs::write(&file, text.replace("to_deg = 25.0", "to_deg = 5.0")).unwrap();
    let browser = Browser::opened(folder, &Opening::of(&file));
    let what_if = json!({ "angle_deg": 5.0, "shape": "bumps_b" });
    let answer = browser.post("/api/depth", &what_if);
    let shown = picture(&answer).to_rgb8();
    let report: serde_json::Value =
        serde_json::from_slice(answer.headers["x-report"].as_bytes()).unwrap();
    let range: [f64; 2] = serde_json::from_value(report["range_mm"].clone()).unwrap();

    let root = browser.folder.path().join("dataset");
    let plan = Plan::read(&file).unwrap();
    generate(&plan, &root, &GenerateSettings::default(), &|_| {}).unwrap();
    let mut differing = 0;
    for (camera, left) in [("left", 0), ("right", shown.width() / 2)] {
        let read = |shape: &str| {
            let file = format!("patient_4/depth/r/{shape}/depth_cam_{camera}_5.0.png");
            image::open(root.join(file)).unwrap().to_luma16()
        };
        let (bumps, orig) = (read("bumps_b"), read("orig"));
        for (x, y, z_mm) in bumps.enumerate_pixels() {
            let pixel = shown.get_pixel(left + x, y).0;
            if z_mm.0[0] == 0 {
                continue;
            }
            // Files store whole millimetres.
            let [low, high] =
                [-0.51, 0.51].map(|by| false_colour(f64::from(z_mm.0[0]) + by, range));
            let between = (0..3).all(|c| {
                let ends = [low[c].min(high[c]), low[c].max(high[c])];
                (ends[0].saturating_sub(1)..=ends[1].saturating_add(1)).contains(&pixel[c])
            });
            assert!(between, "{camera} {x}, {y}: {pixel:?}, {z_mm:?}");
            differing += usize::from(orig.get_pixel(x, y) != z_mm);
        }
    }
    assert!(differing > 100, "{differing}");
    let commands = browser.post("/api/commands", &what_if).json();
    let depth = commands["depth"].as_str().unwrap();
    assert!(depth.contains(" --shape bumps_b "), "{depth}");
}
