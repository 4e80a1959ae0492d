//! The 3D view, use by keyboard only, and a program that has ended.

use std::time::{Duration, Instant};

use fantoccini::Locator;
use image::RgbImage;
use ppa_generate::Case;
use serde_json::json;

use crate::chromium::{PATIENCE, Page, run};

const VIEW: &str = "#view3d canvas";
const JOINT: [u8; 3] = [255, 122, 217];
const PLANE: [u8; 3] = [126, 231, 135];

/// Whether the landmarks are shown.
const READY: &str = "document.getElementById('landmark-table').textContent.includes('Plane')";

/// Returns the centres of all square marks of a colour in the view, in page coordinates, from top to bottom.
async fn marks(page: &Page, colour: [u8; 3]) -> Vec<[f64; 2]> {
    let ([left, top, ..], picture) = page.seen(VIEW).await;
    let is_mark = |x: u32, y: u32| {
        (0..9).all(|dy| (0..9).all(|dx| picture.get_pixel(x + dx, y + dy).0 == colour))
    };
    // Squares of 9 pixels within each mark of 11.
    let mut squares: Vec<Vec<[f64; 2]>> = Vec::new();
    for y in 0..picture.height() - 9 {
        for x in (0..picture.width() - 9).filter(|&x| is_mark(x, y)) {
            let at = [f64::from(left + x) + 4.5, f64::from(top + y) + 4.5];
            match squares.iter_mut().find(|of| apart(of[0], at) < 9.0) {
                Some(of) => of.push(at),
                None => squares.push(vec![at]),
            }
        }
    }
    let middle = |of: &Vec<[f64; 2]>| {
        [0, 1].map(|axis| of.iter().map(|at| at[axis]).sum::<f64>() / of.len() as f64)
    };
    squares.iter().map(middle).collect()
}

fn apart(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Waits until the marks of a colour are as expected and do not change between two pictures.
async fn marks_when(
    page: &Page,
    colour: [u8; 3],
    expected: impl Fn(&[[f64; 2]]) -> bool,
) -> Vec<[f64; 2]> {
    let started = Instant::now();
    let mut before = Vec::new();
    loop {
        let now = marks(page, colour).await;
        if now == before && expected(&now) {
            return now;
        }
        assert!(started.elapsed() < PATIENCE, "{colour:?}: {now:?}");
        before = now;
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
}

/// Returns the displayed (`landmarks`) or automatic (`automatic`) joint and plane, `ct` frame, mm.
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

/// Drags the joint and a point of the plane with the mouse, and reads the saved landmarks.
async fn drag_landmarks(page: Page) {
    page.wait(READY).await;
    page.click("#tab-landmarks").await;
    let case = || Case::read(&page.folder.path().join("p01.edited.case.toml")).unwrap();
    let (joint_found, _) = landmarks(&page, "landmarks").await;

    let joint = *marks_when(&page, JOINT, |marks| !marks.is_empty())
        .await
        .last()
        .unwrap();
    page.drag(joint, [joint[0] + 15.0, joint[1]]).await;
    let row = |n: u32| {
        format!(
            "document.querySelectorAll('#landmark-table tbody tr')[{n}].textContent.includes('chosen')"
        )
    };
    page.wait(&row(0)).await;
    let chosen = case().choices.joint_centre.unwrap();
    let moved = distance(chosen, joint_found);
    // To the right on the screen, horizontally across the patient: the view is from the front, slightly from the right.
    assert!((5.0..60.0).contains(&moved), "{moved}");
    assert!((chosen[2] - joint_found[2]).abs() < 2.0, "{chosen:?}");
    assert!(chosen[0] > joint_found[0], "{chosen:?}");

    // The points of the plane are on the back of the limb and cannot be grabbed from the front.
    let front = marks(&page, PLANE).await;
    let canvas = page.client.find(Locator::Css(VIEW)).await.unwrap();
    canvas.send_keys(&"\u{e014}".repeat(31)).await.unwrap(); // arrow right: by 3.1 rad
    let behind = marks_when(&page, PLANE, |marks| !marks.is_empty() && marks != front).await;
    page.picture("landmarks_behind").await;
    let heel = *behind.last().unwrap();
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

/// Returns the share of drawn pixels without a match in the other picture within one pixel, to `limit` in red, green and blue.
/// Leaves out the caption.
fn missing(picture: &RgbImage, other: &RgbImage, limit: u8) -> f64 {
    const GROUND: [u8; 3] = [10, 13, 18];
    let differ = |a: [u8; 3], b: [u8; 3]| (0..3).map(|c| a[c].abs_diff(b[c])).max().unwrap();
    let (width, height) = (picture.width() - 1, picture.height() - 30);
    let (mut drawn, mut missing) = (0_u32, 0_u32);
    for (x, y) in (1..height).flat_map(|y| (1..width).map(move |x| (x, y))) {
        let pixel = picture.get_pixel(x, y).0;
        if differ(pixel, GROUND) > 25 {
            drawn += 1;
            let mut around = (y - 1..=y + 1).flat_map(|y| (x - 1..=x + 1).map(move |x| (x, y)));
            let is_there = around.any(|(x, y)| differ(pixel, other.get_pixel(x, y).0) <= limit);
            missing += u32::from(!is_there);
        }
    }
    // An empty view counts as missing entirely.
    if drawn > 2000 {
        f64::from(missing) / f64::from(drawn)
    } else {
        1.0
    }
}

#[test]
#[ignore = "needs chromium and chromedriver"]
fn a_browser_without_webgl_shows_the_same_views() {
    run(async {
        let [with, without] = [Page::open().await, Page::without_webgl().await];
        for step in ["skin", "landmarks", "room"] {
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
            }
            // WebGL smooths edges, which makes lines fainter.
            let limit = if step == "room" { 140 } else { 30 };
            let started = Instant::now();
            loop {
                let one = with.seen(VIEW).await.1;
                let other = without.seen(VIEW).await.1;
                let missing = missing(&one, &other, limit).max(missing(&other, &one, limit));
                if missing < 0.05 {
                    break;
                }
                assert!(started.elapsed() < PATIENCE, "{step}: {missing}");
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

/// Drags a camera and its aim point: both stay under the mouse, and the sliders follow.
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
        let four = |marks: &[[f64; 2]]| marks.len() == 4;
        marks_when(&page, WHITE, four).await;
        page.picture("cameras_before").await;
        // Cameras are above their aim points.
        for (mark, kind) in [(0, 0..3), (3, 3..6)] {
            let unmoved = values().await;
            let from = marks_when(&page, WHITE, four).await[mark];
            let to = [from[0] + 30.0, from[1] - 12.0];
            page.drag(from, to).await;
            let arrived = |marks: &[[f64; 2]]| marks.iter().any(|&mark| apart(mark, to) < 3.0);
            marks_when(&page, WHITE, arrived).await;
            let moved: Vec<usize> = (unmoved.iter().zip(values().await).enumerate())
                .filter(|(_, (a, b))| *a != b)
                .map(|(i, _)| i)
                .collect();
            // Only one camera changes, and only its position or only its direction.
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

        // A program restarted without notice has the saved state.
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
