//! Camera views of a case, a placed skin and a room.

use std::fs;
use std::path::Path;

use ppa_depth::DepthImage;
use serde_json::Value;

use crate::{contains, fail, names, phantom, succeed, write_plan};

fn depth(path: &Path) -> DepthImage {
    DepthImage::read_png(path).unwrap()
}

/// Largest difference of two images in mm where both have a depth, and the number of pixels where only one has.
fn differences(a: &DepthImage, b: &DepthImage) -> (f32, usize) {
    let pairs = || a.z_mm.iter().zip(&b.z_mm);
    let both = pairs().filter(|(a, b)| **a > 0.0 && **b > 0.0);
    let alone = pairs().filter(|(a, b)| (**a > 0.0) != (**b > 0.0)).count();
    (both.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max), alone)
}

#[test]
fn a_case_is_rendered_as_its_dataset_shows_it() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let plan = write_plan(
        folder,
        "[shapes]\nvariants = [\"orig\"]\n[soft_tissue]\ndistal_mm = 2.0\nproximal_mm = 3.0\n\
         [positioning]\ntilt_deg = -3.0\nbeam_shift_mm = [12.0, 20.0]\n",
    );
    let text = fs::read_to_string(&plan).unwrap();
    let text = text
        .replace("from_deg = 0.0", "from_deg = 5.0")
        .replace("to_deg = 10.0", "to_deg = 5.0");
    fs::write(&plan, text).unwrap();
    succeed(folder, "generate plan.toml --out dataset");
    let case = phantom().join("p01.toml");
    let render = format!("depth render {} --plan plan.toml --angle 5", case.display());
    contains(
        &succeed(folder, &format!("{render} --out d.png --preview p.png")),
        &["d_left.png", "d_right.png", "pixels see a surface"],
    );
    for side in ["left", "right"] {
        let made = folder.join(format!(
            "dataset/patient_3/depth/r/orig/depth_cam_{side}_5.0.png"
        ));
        let rendered = fs::read(folder.join(format!("d_{side}.png"))).unwrap();
        assert!(fs::read(made).unwrap() == rendered, "{side}");
        assert!(folder.join(format!("p_{side}.png")).exists());
    }
    succeed(folder, &format!("{render} --view right --out one.png"));
    let read = |name: &str| fs::read(folder.join(name)).unwrap();
    assert!(read("one.png") == read("d_right.png"));
    assert!(!names(folder).iter().any(|name| name.starts_with("one_")));
    succeed(
        folder,
        &format!("{render} --sensor default --seed 3 --out noisy.png"),
    );
    assert!(read("noisy_left.png") != read("d_left.png"));
}

/// A skin in the scan and one in the room, each with its motion from the frames, look the same as the case.
#[test]
fn frames_feed_the_renderer() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let case = phantom().join("p01.toml");
    let case = case.display();
    succeed(
        folder,
        &format!("scene place {case} --angle 12 --ply lies.ply --frames frames.json"),
    );
    succeed(folder, "scene room --out room.ply --frames room.json");
    succeed(
        folder,
        &format!("depth render {case} --angle 12 --out case.png"),
    );
    let skin = phantom().join("p01.ply");
    let skin = skin.display();
    let by = "--camera-from-mesh frames.json --motion";
    for side in ["left", "right"] {
        succeed(
            folder,
            &format!("depth render {skin} {by} {side}_from_ct --out scan_{side}.png"),
        );
        succeed(
            folder,
            &format!("depth render lies.ply {by} {side}_from_room --out lies_{side}.png"),
        );
        succeed(
            folder,
            &format!("depth render lies.ply room.ply {by} {side}_from_room --out both_{side}.png"),
        );
        let image = |name: &str| depth(&folder.join(format!("{name}_{side}.png")));
        let (off, alone) = differences(&image("scan"), &image("lies"));
        assert!(off <= 1.0 && alone < 20, "{side}: {off} mm, {alone} pixels");
        let (case, both) = (image("case"), image("both"));
        let pixels = case.z_mm.len();
        assert!(case.valid_pixels() > pixels / 2);
        let far = case
            .z_mm
            .iter()
            .zip(&both.z_mm)
            .filter(|(a, b)| (**a - **b).abs() > 1.0);
        assert!(far.count() * 1000 < pixels, "{side}");
    }
    let without = fail(
        folder,
        "depth render room.ply --camera-from-mesh room.json --out no.png",
    );
    contains(&without, &["room.json", "--motion", "left_from_room"]);
    let unknown = "depth render room.ply --camera-from-mesh room.json --motion up --out no.png";
    contains(&fail(folder, unknown), &["no motion up", "right_from_room"]);
    assert!(!folder.join("no.png").exists());
}

#[test]
fn a_room_that_was_written_renders_and_is_a_room_again() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    succeed(folder, "scene room --out room.ply --frames room.json");
    let by = "--camera-from-mesh room.json --motion left_from_room --json";
    let printed = succeed(folder, &format!("depth render room.ply {by} --out d.png"));
    let printed: Value = serde_json::from_str(&printed).unwrap();
    let image = depth(&folder.join("d.png"));
    assert!(
        image.valid_pixels() * 10 > 9 * image.z_mm.len(),
        "{printed}"
    );
    // The camera is 220 mm beside and 980 mm above the isocentre on the table, at which it looks.
    let middle = image.z_mm[(image.height / 2 * image.width + image.width / 2) as usize];
    assert!((middle - 220_f32.hypot(980.0)).abs() < 4.0, "{middle}");
    // From the origin, on the table, the camera looks up at the collimator.
    succeed(folder, "depth render room.ply --out up.png");

    let plan = write_plan(folder, "[room]\nply = \"room.ply\"\n");
    assert!(plan.exists());
    succeed(folder, "scene room --plan plan.toml --out again.ply --json");
    let table = |options: &str| -> Value {
        serde_json::from_str(&succeed(folder, &format!("scene room {options} --json"))).unwrap()
    };
    let [was, is] = ["--out a.ply", "--plan plan.toml --out b.ply"].map(table);
    let offset = |facts: &Value| facts["table"]["offset_mm"].as_f64().unwrap();
    assert!((offset(&was) - offset(&is)).abs() < 0.1, "{was} {is}");
    assert!(fail(folder, "scene room --out room.stl").contains("room.stl"));
}

/// Points without triangles, as a scanner records them.
#[test]
fn a_cloud_renders_as_discs() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut wall = "ply\nformat ascii 1.0\nelement vertex 2601\nproperty float x\nproperty float y\nproperty float z\nend_header\n".to_owned();
    for i in 0..51 * 51 {
        let [x, y] = [i % 51, i / 51].map(|i| 40.0 * f64::from(i) - 1000.0);
        wall += &format!("{x} {y} 1500\n");
    }
    fs::write(folder.join("cloud.ply"), wall).unwrap();
    succeed(folder, "depth render cloud.ply --out d.png");
    let image = depth(&folder.join("d.png"));
    let middle = image.z_mm[(image.height / 2 * image.width + image.width / 2) as usize];
    assert!((middle - 1500.0).abs() < 1.0, "{middle}");
}

#[test]
fn options_of_cases_and_of_meshes_are_not_mixed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let case = phantom().join("p01.toml");
    let skin = phantom().join("p01.ply");
    let (case, skin) = (case.display(), skin.display());
    for (arguments, part) in [
        (
            format!("{skin} --angle 5"),
            "--angle applies only to a case",
        ),
        (
            format!("{skin} --view left"),
            "--view applies only to a case",
        ),
        (
            format!("{case} --frames 3"),
            "--frames applies only to meshes",
        ),
        (
            format!("{case} --camera c.json"),
            "--camera applies only to meshes",
        ),
        (format!("{case} {skin}"), "render it alone"),
    ] {
        let said = fail(folder, &format!("depth render {arguments} --out no.png"));
        assert!(said.contains(part), "{said}");
    }
    assert!(names(folder).is_empty());
}
