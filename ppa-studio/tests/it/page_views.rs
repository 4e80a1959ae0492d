//! The view in three dimensions, the keyboard alone, and a program that has ended.

use fantoccini::Locator;
use image::RgbImage;
use ppa_generate::Case;
use serde_json::json;

use crate::chromium::{Page, run};

const VIEW: &str = "#view3d canvas";
const JOINT: [u8; 3] = [255, 122, 217];
const PLANE: [u8; 3] = [126, 231, 135];

/// Whether the surface and the landmarks are there.
const READY: &str = "document.getElementById('landmark-table').textContent.includes('Plane')";

/// The middle of the lowest mark of a colour in a picture, which is in the page at `left` and `top`.
fn lowest_mark([left, top, ..]: [u32; 4], picture: &RgbImage, colour: [u8; 3]) -> [f64; 2] {
    let is_mark = |x: u32, y: u32| {
        (0..9).all(|dy| (0..9).all(|dx| picture.get_pixel(x + dx, y + dy).0 == colour))
    };
    let places =
        (0..picture.height() - 9).flat_map(|y| (0..picture.width() - 9).map(move |x| (x, y)));
    let (x, y) = (places
        .filter(|&(x, y)| is_mark(x, y))
        .max_by_key(|&(_, y)| y))
    .unwrap();
    [f64::from(left + x) + 4.5, f64::from(top + y) + 4.5]
}

/// Joint and plane, as they are shown (`landmarks`) or found (`automatic`): `ct` frame, mm.
async fn landmarks(page: &Page, which: &str) -> ([f64; 3], [[f64; 3]; 3]) {
    let ask = "fetch('/api/state').then((r) => r.json()).then(arguments[0])";
    let state = page.client.execute_async(ask, vec![]).await.unwrap();
    let key = |key: &str| state[which][key].clone();
    let joint = serde_json::from_value(key("joint_centre")).unwrap();
    (joint, serde_json::from_value(key("plane_points")).unwrap())
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

/// Drags the joint and a point of the plane with the mouse, and reads what is saved.
async fn drag_landmarks(page: Page) {
    page.wait(READY).await;
    page.click("#tab-landmarks").await;
    let case = || Case::read(&page.folder.path().join("p01.edited.case.toml")).unwrap();
    let (joint_found, _) = landmarks(&page, "landmarks").await;

    let (place, picture) = page.seen(VIEW).await;
    let joint = lowest_mark(place, &picture, JOINT);
    page.drag(joint, [joint[0] + 15.0, joint[1]]).await;
    let row = |n: u32| {
        format!(
            "document.querySelectorAll('#landmark-table tbody tr')[{n}].textContent.includes('chosen')"
        )
    };
    page.wait(&row(0)).await;
    let chosen = case().choices.joint_centre.unwrap();
    let moved = distance(chosen, joint_found);
    // To the right on the screen, which is across the patient and level: the view looks from the front, a little from the right.
    assert!((5.0..60.0).contains(&moved), "{moved}");
    assert!((chosen[2] - joint_found[2]).abs() < 2.0, "{chosen:?}");
    assert!(chosen[0] > joint_found[0], "{chosen:?}");

    // The points of the plane lie on the back of the limb, where they cannot be held from the front.
    let canvas = page.client.find(Locator::Css(VIEW)).await.unwrap();
    canvas.send_keys(&"\u{e014}".repeat(31)).await.unwrap(); // arrow right: by 3.1 rad
    let (place, picture) = page.seen(VIEW).await;
    page.picture("landmarks_behind").await;
    let heel = lowest_mark(place, &picture, PLANE);
    let (_, plane_before) = landmarks(&page, "landmarks").await;
    page.drag(heel, [heel[0], heel[1] - 25.0]).await;
    page.wait(&row(3)).await;
    let [distal, proximal @ ..] = case().choices.plane_points.unwrap();
    assert_eq!(proximal, plane_before[1..]);
    assert!(distal[2] > plane_before[0][2] + 5.0, "{distal:?}");
    let to_skin = "const [place, done] = arguments; fetch('/api/skin').then((r) => r.arrayBuffer()).then((bytes) => { \
                   const points = new Float32Array(bytes, 8, 3 * new Uint32Array(bytes, 0, 1)[0]); let least = Infinity; \
                   for (let i = 0; i < points.length; i += 3) \
                     least = Math.min(least, Math.hypot(...place.map((x, axis) => x - points[i + axis]))); \
                   done(least); });";
    let to_skin = page
        .client
        .execute_async(to_skin, vec![json!(distal)])
        .await;
    assert!(to_skin.unwrap().as_f64().unwrap() < 3.0);
    page.close().await;
}

#[test]
#[ignore = "needs chromium and chromedriver"]
fn landmarks_are_dragged_in_three_dimensions() {
    run(async { drag_landmarks(Page::open().await).await });
}

#[test]
#[ignore = "needs chromium and chromedriver"]
fn landmarks_are_dragged_without_webgl() {
    run(async { drag_landmarks(Page::without_webgl().await).await });
}

/// Share of what is drawn in a picture that another one does not show within a pixel, to `limit` in red, green and blue. The caption is left out.
fn missing(picture: &RgbImage, other: &RgbImage, limit: u8) -> f64 {
    const GROUND: [u8; 3] = [10, 13, 18];
    let apart = |a: [u8; 3], b: [u8; 3]| (0..3).map(|c| a[c].abs_diff(b[c])).max().unwrap();
    let (width, height) = (picture.width() - 1, picture.height() - 30);
    let (mut drawn, mut missing) = (0, 0);
    for (x, y) in (1..height).flat_map(|y| (1..width).map(move |x| (x, y))) {
        let pixel = picture.get_pixel(x, y).0;
        if apart(pixel, GROUND) > 25 {
            drawn += 1;
            let mut around = (y - 1..=y + 1).flat_map(|y| (x - 1..=x + 1).map(move |x| (x, y)));
            let is_there = around.any(|(x, y)| apart(pixel, other.get_pixel(x, y).0) <= limit);
            missing += usize::from(!is_there);
        }
    }
    assert!(drawn > 2000, "{drawn}");
    missing as f64 / drawn as f64
}

#[test]
#[ignore = "needs chromium and chromedriver"]
fn a_browser_without_webgl_shows_the_same_views() {
    run(async {
        let [with, without] = [Page::open().await, Page::without_webgl().await];
        for step in ["skin", "landmarks", "room"] {
            let mut pictures = Vec::new();
            for page in [&with, &without] {
                page.wait(READY).await;
                page.click(&format!("#tab-{step}")).await;
                if step == "skin" {
                    page.pick("skin-shape", "bumps_a").await;
                    page.wait(
                        "document.getElementById('shape-legend').textContent.includes('Moved by')",
                    )
                    .await;
                }
                if step == "room" {
                    page.wait("document.getElementById('coverage').textContent.includes('%')")
                        .await;
                }
                // Frames are drawn at once, surfaces when they have come.
                tokio::time::sleep(std::time::Duration::from_secs(2)).await;
                pictures.push(page.seen(VIEW).await.1);
            }
            // WebGL smooths edges, and draws lines fainter for it.
            let limit = if step == "room" { 140 } else { 30 };
            for [one, other] in [[0, 1], [1, 0]] {
                let missing = missing(&pictures[one], &pictures[other], limit);
                assert!(missing < 0.05, "{step}: {missing}");
            }
        }
        with.close().await;
        without.close().await;
    });
}

#[test]
#[ignore = "needs chromium and chromedriver"]
fn a_landmark_is_placed_by_keys_alone() {
    run(async {
        let page = Page::open().await;
        page.wait(READY).await;
        let tab_to = async |selector: &str| {
            let there = format!("document.activeElement.matches({})", json!(selector));
            for _ in 0..60 {
                if page.value(&there).await == json!(true) {
                    return;
                }
                page.press("\u{e004}").await;
            }
            panic!("Tab does not lead to {selector}");
        };
        tab_to("#tab-scan").await;
        page.press("\u{e014}\u{e014}").await; // arrow right, to step 3
        page.wait("document.body.dataset.step === 'landmarks'")
            .await;
        tab_to("[data-axis='2'] canvas").await;
        page.press("\u{e013}\u{e013}\u{e013}").await; // arrow up
        tab_to("#joint-here").await;
        page.press("\u{e007}").await; // Enter
        let chosen =
            "document.querySelector('#landmark-table tbody tr').textContent.includes('chosen')";
        page.wait(chosen).await;
        let edited = page.folder.path().join("p01.edited.case.toml");
        let joint = Case::read(&edited).unwrap().choices.joint_centre.unwrap();
        let up = joint[2] - landmarks(&page, "automatic").await.0[2];
        // Three slices of 1.25 mm, from the nearest one.
        assert!((3.0..4.5).contains(&up), "{up}");
        page.press("\u{e009}z\u{e000}").await; // Ctrl+Z
        page.wait(&format!("!{chosen}")).await;
        page.close().await;
    });
}

/// Middles of all square marks of a colour in a picture that is in the page at `left` and `top`, from above to below.
fn marks([left, top, ..]: [u32; 4], picture: &RgbImage, colour: [u8; 3]) -> Vec<[f64; 2]> {
    let is_mark = |x: u32, y: u32| {
        (0..9).all(|dy| (0..9).all(|dx| picture.get_pixel(x + dx, y + dy).0 == colour))
    };
    let mut found: Vec<[f64; 2]> = Vec::new();
    for y in 0..picture.height() - 9 {
        for x in 0..picture.width() - 9 {
            let at = [f64::from(left + x) + 4.5, f64::from(top + y) + 4.5];
            let near = |one: &&mut [f64; 2]| (one[0] - at[0]).hypot(one[1] - at[1]) < 9.0;
            if is_mark(x, y) && !found.iter_mut().any(|one| near(&one)) {
                found.push(at);
            }
        }
    }
    found
}

/// Drags a camera, and the middle of what it sees: both stay under the mouse, and the sliders follow.
#[test]
#[ignore = "needs chromium and chromedriver"]
fn cameras_are_dragged_in_three_dimensions() {
    const WHITE: [u8; 3] = [255, 255, 255];
    run(async {
        let page = Page::open().await;
        page.wait(READY).await;
        page.click("#tab-room").await;
        page.wait("document.getElementById('coverage').textContent.includes('Seen by')")
            .await;
        let values = async || {
            let ask = "[...document.querySelectorAll('#cameras-form input')].map((i) => Number(i.labels[0].textContent.match(/-?[\\d.]+/)[0]))";
            let values = page.value(ask).await;
            serde_json::from_value::<Vec<f64>>(values).unwrap()
        };
        let (place, picture) = page.seen(VIEW).await;
        let before = marks(place, &picture, WHITE);
        assert_eq!(before.len(), 4, "{before:?}");
        page.picture("cameras_before").await;
        // Cameras hang above what they see.
        for (mark, kind) in [(0, 0..3), (3, 3..6)] {
            let unmoved = values().await;
            let (place, picture) = page.seen(VIEW).await;
            let from = marks(place, &picture, WHITE)[mark];
            let to = [from[0] + 30.0, from[1] - 12.0];
            page.drag(from, to).await;
            page.wait("!document.getElementById('cameras-back').disabled")
                .await;
            page.wait("!document.body.hasAttribute('aria-busy')").await;
            tokio::time::sleep(std::time::Duration::from_secs(1)).await;
            let (place, picture) = page.seen(VIEW).await;
            let after = marks(place, &picture, WHITE);
            let away = |at: &[f64; 2]| (at[0] - to[0]).hypot(at[1] - to[1]);
            let nearest = after.iter().map(away).fold(f64::INFINITY, f64::min);
            assert!(nearest < 3.0, "{to:?}: {after:?}");
            let moved: Vec<usize> = (unmoved.iter().zip(values().await).enumerate())
                .filter(|(_, (a, b))| *a != b)
                .map(|(i, _)| i)
                .collect();
            // Of one camera, and only where it is or only where it looks.
            assert!(!moved.is_empty());
            assert!(
                moved
                    .iter()
                    .all(|i| i / 6 == moved[0] / 6 && kind.contains(&(i % 6))),
                "{moved:?}"
            );
        }
        page.picture("cameras_dragged").await;
        page.close().await;
    });
}

#[test]
#[ignore = "needs chromium and chromedriver"]
fn a_page_goes_on_when_the_program_starts_again() {
    run(async {
        let mut page = Page::open().await;
        page.wait(READY).await;
        page.click("#tab-dataset").await;
        page.wait("!document.getElementById('dataset-absent').hidden")
            .await;
        page.click("#tab-landmarks").await;
        page.stop();
        page.click("#joint-here").await;
        let message = "document.getElementById('message').textContent";
        page.wait(&format!(
            "{message}.startsWith('ppa studio does not answer')"
        ))
        .await;
        page.start_again();
        page.wait(&format!("{message} === 'ppa studio was started again'"))
            .await;
        page.click("#joint-here").await;
        page.wait("document.querySelectorAll('#landmark-table tbody tr')[0].textContent.includes('chosen')")
            .await;

        // A program that was started again unnoticed has what was saved.
        page.stop();
        page.start_again();
        page.click("#undo").await;
        page.wait(&format!("{message} !== ''")).await;
        page.wait("document.getElementById('undo').disabled").await;
        page.wait("document.querySelectorAll('#landmark-table tbody tr')[0].textContent.includes('chosen')")
            .await;
        page.client.clone().close().await.unwrap();
    });
}
