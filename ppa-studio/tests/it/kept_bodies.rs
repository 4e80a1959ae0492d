//! Bodies next to the limb that are kept as parts of it.

use std::path::{Path, PathBuf};

use axum::http::StatusCode;
use ppa_ct::{Grid, ReadOptions, Volume, write_nifti};
use ppa_generate::{Case, PreparedLimb, prepare};
use ppa_mesh::LimbSettings;
use ppa_phantom::{LowerLeg, TableTop};
use ppa_scene::{LandmarkOverrides, Side};
use serde_json::{Value, json};

use crate::browser::Browser;
use crate::chromium::{Page, run};

const VOXEL_MM: f64 = 2.0;

/// Writes P01 with a 40 mm block in the air next to the calf, and its case; also returns the centre of the block.
fn with_block(folder: &Path) -> (PathBuf, [f64; 3]) {
    let leg = LowerLeg::p01();
    let scan = leg.voxelise(VOXEL_MM, TableTop::Absent).unwrap();
    let size = scan.grid().size();
    // Additional columns for the block and the air before it.
    let more = 32;
    let spacing = scan.grid().spacing_mm();
    let origin = scan.grid().centre([-(more as f64), 0.0, 0.0]);
    let grid = Grid::axis_aligned([size[0] + more, size[1], size[2]], spacing, origin).unwrap();
    let centre = [11, size[1] / 2, size[2] / 2];
    let hu = (0..grid.len()).map(|at| {
        let [i, j, k] = grid.voxel(at);
        let in_block = [i, j, k]
            .iter()
            .zip(centre)
            .all(|(a, b)| a.abs_diff(b) <= 10);
        match i.checked_sub(more) {
            _ if in_block => 60.0,
            Some(i) => scan.at([i, j, k]),
            None => -1000.0,
        }
    });
    let volume = Volume::new(grid.clone(), hu.collect()).unwrap();
    write_nifti(&folder.join("p01.nii"), &volume).unwrap();
    let file = folder.join("p01.case.toml");
    prepared(folder, &[]).0.write(&file).unwrap();
    (file, grid.centre(centre.map(|v| v as f64)).into())
}

/// Makes the case of the scan like `ppa prepare --keep`.
fn prepared(folder: &Path, kept: &[[f64; 3]]) -> (Case, PreparedLimb) {
    let surface = LimbSettings {
        kept: kept.to_vec(),
        ..LimbSettings::default()
    };
    let (reading, choices) = (ReadOptions::default(), LandmarkOverrides::default());
    let scan = folder.join("p01.nii");
    prepare(&scan, &reading, Side::Right, &surface, &choices).unwrap()
}

/// Returns the mean of the displayed vertices of the removed parts, and their number of triangles.
fn removed(browser: &Browser) -> ([f64; 3], usize) {
    let answer = browser.get("/api/removed");
    assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
    let word = |at: usize| <[u8; 4]>::try_from(&answer.body[at..at + 4]).unwrap();
    let [vertices, triangles] = [0, 4].map(|at| u32::from_le_bytes(word(at)) as usize);
    let of_axis = |axis: usize| {
        let values = (0..vertices).map(|v| f32::from_le_bytes(word(8 + 4 * (3 * v + axis))));
        values.map(f64::from).sum::<f64>() / vertices as f64
    };
    ([0, 1, 2].map(of_axis), triangles)
}

fn kept_points(state: &Value) -> usize {
    let bodies = state["report"]["bodies"].as_array().unwrap().iter();
    bodies.filter(|body| body.get("kept").is_some()).count()
}

#[test]
fn a_kept_body_is_that_of_the_command_and_is_undone() {
    let folder = tempfile::tempdir().unwrap();
    let (file, block) = with_block(folder.path());
    let browser = Browser::of(folder, file);
    let before = browser.get("/api/state").json();
    assert_eq!(kept_points(&before), 0);
    // The removed part is the block, until it is kept.
    let (middle, triangles) = removed(&browser);
    let off = std::iter::zip(middle, block).map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f64::max) < 0.5, "{middle:?} {block:?}");
    assert!(triangles > 1000, "{triangles}");
    let click = |point: [f64; 3]| browser.post("/api/body", &json!({ "point": point }));
    let state = click(block).json();
    assert_eq!(kept_points(&state), 1);
    assert_eq!(removed(&browser).1, 0);
    let codes: Vec<&Value> = state["findings"]
        .as_array()
        .unwrap()
        .iter()
        .map(|f| &f["code"])
        .collect();
    assert!(codes.contains(&&json!("body-kept")), "{codes:?}");
    let [x, y, z] = block;
    let command = state["commands"]["prepare"].as_str().unwrap();
    assert!(
        command.contains(&format!(" --keep={x},{y},{z}")),
        "{command}"
    );

    // The command and the changed case give the same result.
    let (expected, limb) = prepared(browser.folder.path(), &[block]);
    let edited = Case::read(&browser.folder.path().join("p01.edited.case.toml")).unwrap();
    assert_eq!(edited.surface, expected.surface);
    let shown = serde_json::to_value(&limb.limb.report).unwrap();
    assert_eq!(state["report"], shown);
    let again = PreparedLimb::of_case(&edited).unwrap();
    assert_eq!(again.limb, limb.limb);
    assert_eq!(again.landmarks, limb.landmarks);

    let state = browser.post("/api/undo", &json!({})).json();
    assert_eq!(state["report"], before["report"]);
    let state = browser.post("/api/redo", &json!({})).json();
    assert_eq!(kept_points(&state), 1);
    // Another point of the same body.
    let state = click([x - 5.0, y, z]).json();
    assert_eq!(state["report"], before["report"]);
    let leg: [f64; 3] =
        serde_json::from_value(before["landmarks"]["joint_centre"].clone()).unwrap();
    for (point, says) in [
        ([x, y + 60.0, z], "is not in solid tissue"),
        (leg, "is in the limb itself"),
    ] {
        let refused = click(point);
        assert_eq!(refused.status, StatusCode::UNPROCESSABLE_ENTITY);
        assert!(refused.text().contains(says), "{}", refused.text());
    }
    let state = browser.post("/api/undo", &json!({})).json();
    assert_eq!(kept_points(&state), 1);
}

#[test]
fn a_removed_ball_is_that_of_the_command_and_is_undone() {
    let folder = tempfile::tempdir().unwrap();
    let (file, [x, y, z]) = with_block(folder.path());
    let browser = Browser::of(folder, file);
    let before = browser.get("/api/state").json();
    // Half of the block.
    let ball = json!({ "centre_mm": [x - 20.0, y, z], "radius_mm": 20.0 });
    let remove = |balls: Value| browser.post("/api/surface", &json!({ "removed": balls }));
    let state = remove(json!([ball])).json();
    assert_eq!(state["removed"], json!([ball]));
    let findings = state["findings"].as_array().unwrap();
    assert!(findings.iter().any(|f| f["code"] == "part-removed"));
    let command = state["commands"]["prepare"].as_str().unwrap();
    let flag = format!(" --remove={},{y},{z},20", x - 20.0);
    assert!(command.contains(&flag), "{command}");
    let volume = |state: &Value| state["report"]["bodies"][1]["core_mm3"].as_f64().unwrap();
    assert!(volume(&state) < 0.8 * volume(&before));
    assert_eq!(
        state["report"]["limb_voxels"],
        before["report"]["limb_voxels"]
    );
    let edited = Case::read(&browser.folder.path().join("p01.edited.case.toml")).unwrap();
    let again = PreparedLimb::of_case(&edited).unwrap();
    let shown = serde_json::to_value(&again.limb.report).unwrap();
    assert_eq!(state["report"], shown);
    let state = browser.post("/api/undo", &json!({})).json();
    assert_eq!(state["report"], before["report"]);
    let none = json!({ "centre_mm": [x, y, z], "radius_mm": -1.0 });
    let refused = remove(json!([none]));
    assert_eq!(refused.status, StatusCode::UNPROCESSABLE_ENTITY);
    assert!(
        refused.text().contains("radius_mm is -1"),
        "{}",
        refused.text()
    );
}

/// Returns the place of a point on the canvas of the initial 3D view: field of view of 30 degrees, rotated by -0.6 and 0.25 rad.
fn on_screen(point: [f64; 3], skin: &ppa_mesh::Mesh, [width, height]: [f64; 2]) -> [f64; 2] {
    use nalgebra::{Point3, Vector3};
    let (azimuth, elevation) = (-0.6_f64, 0.25_f64);
    let across = elevation.cos();
    let back = Vector3::new(
        across * azimuth.sin(),
        -across * azimuth.cos(),
        elevation.sin(),
    );
    let right = Vector3::z().cross(&back).normalize();
    let up = back.cross(&right);
    let corner = |pick: fn(f64, f64) -> f64, from: f64| {
        let vertices = skin.vertices.iter().map(|v| v.cast::<f64>());
        vertices.fold(Point3::new(from, from, from), |a, b| {
            Point3::new(pick(a.x, b.x), pick(a.y, b.y), pick(a.z, b.z))
        })
    };
    let (low, high) = (
        corner(f64::min, f64::INFINITY),
        corner(f64::max, f64::NEG_INFINITY),
    );
    let half = 15_f64.to_radians().tan();
    let distance = 1.1 * (high - low).norm() / (2.0 * half);
    let from_centre = Point3::from(point) - nalgebra::center(&low, &high);
    let depth = distance - from_centre.dot(&back);
    let [u, v] = [right, up].map(|axis| from_centre.dot(&axis) / (depth * half));
    [0.5 * (width + u * height), 0.5 * (1.0 - v) * height]
}

/// Counts the orange pixels of the 3D view.
async fn orange(page: &Page) -> usize {
    let place = "(() => { const r = document.querySelector('#view3d canvas').getBoundingClientRect(); \
                 return [r.x, r.y, r.width, r.height].map(Math.floor); })()";
    let [x, y, width, height]: [u32; 4] = serde_json::from_value(page.value(place).await).unwrap();
    let png = page.client.screenshot().await.unwrap();
    let seen = image::load_from_memory(&png).unwrap().to_rgb8();
    let view = image::imageops::crop_imm(&seen, x, y, width, height).to_image();
    let is_orange = |[r, g, b]: [u8; 3]| {
        let [r, g, b] = [r, g, b].map(u32::from);
        r > 60 && 4 * g < 3 * r && 5 * b < 2 * r
    };
    view.pixels().filter(|pixel| is_orange(pixel.0)).count()
}

/// Waits until the 3D view shows the removed parts, or does not.
async fn until_removed_is_shown(page: &Page, shown: bool) {
    for _ in 0..200 {
        if (orange(page).await > 200) == shown {
            return;
        }
    }
    panic!("{} orange pixels", orange(page).await);
}

#[test]
#[ignore = "needs chromium and chromedriver"]
fn a_body_is_kept_and_removed_by_buttons() {
    run(async {
        let folder = tempfile::tempdir().unwrap();
        let (file, block) = with_block(folder.path());
        let page = Page::of(folder, &file).await;
        page.click("#tab-skin").await;
        let bodies = "document.getElementById('bodies').textContent";
        page.wait(&format!("{bodies}.includes('removed: ')")).await;
        // The removed parts are orange in the 3D view; there is no orange if they are hidden.
        until_removed_is_shown(&page, true).await;
        page.picture("skin_removed").await;
        page.click("#show-removed").await;
        until_removed_is_shown(&page, false).await;
        page.click("#show-removed").await;
        until_removed_is_shown(&page, true).await;
        page.click("#tab-landmarks").await;
        until_removed_is_shown(&page, false).await;
        page.click("#tab-skin").await;
        until_removed_is_shown(&page, true).await;
        page.click("#bodies [aria-label^='Show'] ~ [aria-label^='Keep']")
            .await;
        page.wait(&format!("{bodies}.includes('kept: ')")).await;
        page.wait("document.getElementById('command-list').textContent.includes('--keep=')")
            .await;
        until_removed_is_shown(&page, false).await;
        page.picture("skin_kept").await;
        page.click("#undo").await;
        page.wait(&format!("!{bodies}.includes('kept: ')")).await;
        page.wait("!document.getElementById('redo').disabled").await;
        page.click("#redo").await;
        page.wait(&format!("{bodies}.includes('kept: ')")).await;
        page.click("#bodies [aria-label^='Remove']").await;
        page.wait(&format!("!{bodies}.includes('kept: ')")).await;

        // Clicks on the block in the 3D view.
        let size = page.value("(() => { const c = document.querySelector('#view3d canvas'); return [c.clientWidth, c.clientHeight]; })()").await;
        let size: [f64; 2] = serde_json::from_value(size).unwrap();
        let skin = prepared(page.folder.path(), &[]).1.limb.mesh.clone();
        let click = |point: [f64; 3]| {
            let at = on_screen(point, &skin, size);
            let script = "const [x, y] = arguments[0]; const c = document.querySelector('#view3d canvas'); \
                          c.setPointerCapture = () => {}; const r = c.getBoundingClientRect(); \
                          for (const kind of ['pointerdown', 'pointerup']) c.dispatchEvent(new PointerEvent(kind, { \
                            clientX: r.left + x, clientY: r.top + y, bubbles: true }));";
            page.client.execute(script, vec![json!(at)])
        };
        let ready = "document.getElementById('body-pick').ariaPressed === 'true' && !document.getElementById('body-pick').ariaBusy";
        page.click("#body-pick").await;
        page.wait(ready).await;
        page.picture("skin_bodies").await;
        click(block).await.unwrap();
        page.wait(&format!("{bodies}.includes('kept: ')")).await;
        page.wait("document.getElementById('body-pick').ariaPressed === 'false'")
            .await;
        page.wait("!document.body.ariaBusy").await;
        page.picture("skin_clicked").await;
        page.click("#body-pick").await;
        page.wait(ready).await;
        click(block).await.unwrap();
        page.wait(&format!("!{bodies}.includes('kept: ')")).await;
        page.wait("!document.body.ariaBusy").await;

        // The body at the crosshair.
        page.click("#bodies li:not(:first-child) [aria-label^='Show']")
            .await;
        page.click("#body-here").await;
        page.wait(&format!("{bodies}.includes('kept: ')")).await;

        // A ball around the tip of a toe, where a click on the skin puts the crosshair.
        let vertices = skin.vertices.iter();
        let tip = vertices.min_by(|a, b| a.y.total_cmp(&b.y)).unwrap();
        click(tip.cast::<f64>().into()).await.unwrap();
        page.click("#cut summary").await;
        page.slide("cut-radius", 15.0).await;
        page.picture("skin_cut_preview").await;
        page.click("#cut-here").await;
        let cuts = "document.getElementById('cuts').textContent";
        page.wait(&format!("{cuts}.includes('ball of 15 mm')"))
            .await;
        page.wait("document.getElementById('command-list').textContent.includes('--remove=')")
            .await;
        page.wait("!document.body.ariaBusy").await;
        page.picture("skin_cut").await;
        page.client.set_window_size(600, 900).await.unwrap();
        page.picture("skin_cut_narrow").await;
        page.client.set_window_size(1280, 800).await.unwrap();
        page.click("#cuts [aria-label^='Put back']").await;
        page.wait(&format!("{cuts} === ''")).await;
        page.client.set_window_size(600, 900).await.unwrap();
        page.picture("skin_kept_narrow").await;
        page.click("#bodies [aria-label^='Remove']").await;
        page.wait(&format!("!{bodies}.includes('kept: ')")).await;
        page.wait("!document.body.ariaBusy").await;
        page.picture("skin_removed_narrow").await;
        page.close().await;
    });
}
