//! The page in Chromium: each step as used by a person.

use fantoccini::Locator;
use ppa_generate::Case;
use ppa_studio::Opening;
use serde_json::json;

use crate::browser::fine_phantom;
use crate::chromium::{Page, run};
use crate::networks::networks;

#[test]
#[ignore = "needs chromium and chromedriver"]
fn slices_follow_keys_and_the_window() {
    run(async {
        let page = Page::open().await;
        let caption = "document.querySelector('[data-axis=\"2\"] figcaption').textContent";
        page.wait(&format!("{caption}.startsWith('k = ')")).await;
        let before = page.value(caption).await;
        page.picture("scan").await;
        let canvas = Locator::Css("[data-axis='2'] canvas");
        let canvas = page.client.find(canvas).await.unwrap();
        canvas.send_keys("\u{e013}").await.unwrap(); // arrow up
        page.wait(&format!("{caption} !== {before}")).await;
        // A lower level is brighter.
        let light = "(() => { const c = document.querySelector('[data-axis=\"2\"] canvas'); \
                     const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; \
                     let s = 0; for (let i = 0; i < d.length; i += 4) s += d[i]; return s; })()";
        let dark = page.value(light).await.as_f64().unwrap();
        page.slide("level", -400.0).await;
        assert!(page.value(light).await.as_f64().unwrap() > 1.2 * dark);
        page.close().await;
    });
}

/// Place of the right edge of the crop box in the slice across the third axis.
const CROP_EDGE: &str = "(() => { const c = document.querySelector('[data-axis=\"2\"] canvas'); \
                         const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let [x, y] = [0, 0]; \
                         for (let i = 0; i < d.length; i += 4) if (d[i] > 230 && Math.abs(d[i + 1] - 180) < 20 && d[i + 2] < 110) \
                           if ((i / 4) % c.width > x) [x, y] = [(i / 4) % c.width, Math.floor(i / 4 / c.width)]; \
                         return [x, c.height / 2]; })()";

#[test]
#[ignore = "needs chromium and chromedriver"]
fn a_dragged_edge_crops_the_scan() {
    run(async {
        let page = Page::open().await;
        page.wait("document.getElementById('crop-i-low').value === '0'")
            .await;
        let fields =
            "['i', 'j', 'k'].map((a) => document.getElementById(`crop-${a}-high`).value).join()";
        let low =
            "['i', 'j', 'k'].map((a) => document.getElementById(`crop-${a}-low`).value).join()";
        let whole = [page.value(low).await, page.value(fields).await];
        page.click("#crop-start").await;
        let at = page.value(CROP_EDGE).await;
        let drag = "const [x, y] = arguments[0]; const c = document.querySelector('[data-axis=\"2\"] canvas'); \
                    c.setPointerCapture = () => {}; const r = c.getBoundingClientRect(); \
                    for (const [type, dx] of [['pointerdown', 0], ['pointermove', -14], ['pointerup', -14]]) \
                      c.dispatchEvent(new PointerEvent(type, {bubbles: true, pointerId: 1, clientX: r.x + x + dx, clientY: r.y + y}));";
        page.client.execute(drag, vec![at]).await.unwrap();
        let edited = page.folder.path().join("p01.edited.case.toml");
        page.until(|| edited.exists()).await;
        let crop = Case::read(&edited).unwrap().surface.crop.unwrap();
        page.wait("!document.getElementById('crop-all').disabled")
            .await;
        assert_eq!(
            page.value(low).await,
            json!(crop.low.map(|v| v.to_string()).join(","))
        );
        assert_eq!(
            page.value(fields).await,
            json!(crop.high.map(|v| (v - 1).to_string()).join(","))
        );
        assert_ne!([page.value(low).await, page.value(fields).await], whole);
        page.picture("crop").await;
        page.click("#crop-all").await;
        page.wait("document.getElementById('crop-all').disabled")
            .await;
        assert_eq!(Case::read(&edited).unwrap().surface.crop, None);
        // The limb around the crosshair, which is at the joint.
        page.click("#tab-skin").await;
        page.click("#limb-here").await;
        page.wait("!document.getElementById('limb-find').disabled")
            .await;
        assert!(Case::read(&edited).unwrap().surface.inside.is_some());
        page.click("#limb-find").await;
        page.wait("document.getElementById('limb-find').disabled")
            .await;
        page.close().await;
    });
}

/// Centre of the joint's mark in the slice across the second axis, from the pixels of its colour.
const JOINT: &str = "(() => { const c = document.querySelector('[data-axis=\"1\"] canvas'); \
                     const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let [n, x, y] = [0, 0, 0]; \
                     for (let i = 0; i < d.length; i += 4) if (d[i] === 255 && d[i + 1] === 122 && d[i + 2] === 217) \
                       { n += 1; x += (i / 4) % c.width; y += Math.floor(i / 4 / c.width); } \
                     return [x / n, y / n]; })()";

#[test]
#[ignore = "needs chromium and chromedriver"]
fn a_dragged_landmark_is_saved_and_undone() {
    run(async {
        let page = Page::open().await;
        page.click("#tab-landmarks").await;
        let joint = "document.querySelector('#landmark-table tbody tr').textContent";
        page.wait(&format!("!{joint}.includes('chosen')")).await;
        page.picture("landmarks").await;
        let at = page.value(JOINT).await;
        let drag = "const [x, y] = arguments[0]; const c = document.querySelector('[data-axis=\"1\"] canvas'); \
                    c.setPointerCapture = () => {}; const r = c.getBoundingClientRect(); \
                    for (const [type, dx] of [['pointerdown', 0], ['pointermove', 12], ['pointerup', 12]]) \
                      c.dispatchEvent(new PointerEvent(type, {bubbles: true, pointerId: 1, clientX: r.x + x + dx, clientY: r.y + y}));";
        page.client.execute(drag, vec![at]).await.unwrap();
        page.wait(&format!("{joint}.includes('chosen')")).await;
        let edited = page.folder.path().join("p01.edited.case.toml");
        let chosen = Case::read(&edited).unwrap().choices.joint_centre.unwrap();
        page.picture("landmarks_chosen").await;

        // In a field of text, the keys that undo a change undo typing only.
        page.click("#tab-generation").await;
        page.click("#plan-folder").await;
        page.press("\u{e009}z\u{e000}").await;
        page.click("#tab-landmarks").await;
        page.wait("!document.body.hasAttribute('aria-busy')").await;
        assert_eq!(
            Case::read(&edited).unwrap().choices.joint_centre,
            Some(chosen)
        );

        // A reload shows the same; the keyboard undoes it.
        page.client.refresh().await.unwrap();
        page.wait(&format!(
            "!!document.querySelector('#landmark-table tbody tr') && {joint}.includes('chosen')"
        ))
        .await;
        assert_eq!(
            Case::read(&edited).unwrap().choices.joint_centre,
            Some(chosen)
        );
        let body = page.client.find(Locator::Css("body")).await.unwrap();
        body.send_keys("\u{e009}z\u{e000}").await.unwrap();
        page.wait(&format!("!{joint}.includes('chosen')")).await;
        assert_eq!(Case::read(&edited).unwrap().choices.joint_centre, None);

        // A region set by its number, and found again by its button.
        page.fill("#joint_region-from", "9").await;
        page.wait(
            "document.querySelectorAll('#landmark-table tbody tr')[1].textContent.includes('chosen')",
        )
        .await;
        assert!(Case::read(&edited).unwrap().choices.joint_region.is_some());
        // Two changes at once are both made.
        let at_once = "for (const id of ['calf_region-from', 'calf_region-to']) { const field = document.getElementById(id); \
                       field.value = Number(field.value) + 1; field.dispatchEvent(new Event('change')); }";
        let ends = "['from', 'to'].map((end) => Number(document.getElementById(`calf_region-${end}`).value) + 1)";
        let ends: [f64; 2] = serde_json::from_value(page.value(ends).await).unwrap();
        page.client.execute(at_once, vec![]).await.unwrap();
        page.until(|| Case::read(&edited).unwrap().choices.calf_region == Some(ends))
            .await;
        page.click("[aria-label='Find again: Axis']").await;
        page.wait(
            "document.querySelectorAll('#landmark-table tbody tr')[1].textContent.includes('chosen') === false",
        )
        .await;
        page.close().await;
    });
}

#[test]
#[ignore = "needs chromium and chromedriver"]
fn the_skin_follows_the_iso_value() {
    run(async {
        let page = Page::open().await;
        page.click("#tab-skin").await;
        let points = "document.querySelector('#skin-facts').textContent";
        page.wait(&format!("{points}.includes('Points')")).await;
        let before = page.value(points).await;
        page.slide("iso", -300.0).await;
        page.wait(&format!("{points} !== {before}")).await;
        page.picture("skin").await;
        let edited = page.folder.path().join("p01.edited.case.toml");
        assert_eq!(Case::read(&edited).unwrap().surface.iso_hu, -300.0);
        page.close().await;
    });
}

#[test]
#[ignore = "needs chromium and chromedriver"]
fn a_body_shape_is_shown_with_its_shift_in_step_2_only() {
    run(async {
        let page = Page::open().await;
        page.click("#tab-skin").await;
        page.pick("skin-shape", "bumps_a").await;
        let legend = "document.querySelector('#shape-legend').textContent";
        page.wait(&format!("{legend}.includes('Moved by')")).await;
        page.picture("guide_skin").await;
        page.click("#tab-landmarks").await;
        page.wait(&format!("{legend} === ''")).await;
        page.click("#tab-skin").await;
        page.wait(&format!("{legend}.includes('Moved by')")).await;
        // If the step is left before the surface arrives, the surface is not shown.
        page.pick("skin-shape", "big").await;
        page.click("#tab-landmarks").await;
        page.wait(&format!("{legend} === ''")).await;
        page.click("#tab-skin").await;
        page.wait(&format!("{legend}.includes('Moved by')")).await;
        page.pick("skin-shape", "").await;
        page.wait(&format!("{legend} === ''")).await;
        page.close().await;
    });
}

#[test]
#[ignore = "needs chromium and chromedriver"]
fn images_follow_the_sliders_and_the_newest_wins() {
    run(async {
        let folder = tempfile::tempdir().unwrap();
        let opening = Opening {
            networks: Some(networks()),
            ..Opening::of(&fine_phantom(folder.path()))
        };
        let page = Page::opened(folder, &opening).await;
        page.click("#tab-whatif").await;
        page.wait("/^Networks -?[0-9.]+: .*left camera/.test(document.getElementById('network').textContent)")
            .await;
        page.wait("document.querySelector('#radiograph').dataset.pass === 'final'")
            .await;
        page.wait("!!document.querySelector('#depth img').src")
            .await;
        page.picture("whatif").await;
        // Of a hundred events within a second, the last one is shown.
        for step in 0..100 {
            page.slide("slider-angle_deg", f64::from(step) * 0.5).await;
        }
        page.slide("slider-angle_deg", 18.0).await;
        // A late answer does not replace that to a later request.
        page.delay_next("/api/commands").await;
        page.slide("slider-angle_deg", 7.0).await;
        page.slide("slider-angle_deg", 18.0).await;
        page.wait("window.late").await;
        page.wait("document.querySelector('#command-list').textContent.includes('--angle 18 ')")
            .await;
        // The dose is offered when the radiograph of the newest exposure is complete.
        page.wait("!document.getElementById('dose-begin').disabled")
            .await;
        page.picture("guide_whatif").await;
        page.click("#dose-begin").await;
        page.wait("document.getElementById('dose-table').textContent.includes('bone')")
            .await;
        page.picture("whatif_dose").await;
        page.slide("slider-distal_mm", 30.0).await;
        page.wait("document.getElementById('dose-table').childElementCount === 0")
            .await;
        assert_eq!(
            page.value("document.getElementById('slider-distal_mm').value")
                .await,
            json!("20")
        );

        // Sliders that were not moved show the exposure of the technique.
        page.pick("technique", "knee").await;
        page.wait("document.getElementById('slider-kvp').value === '65'")
            .await;
        let kvp = "document.querySelector('label[for=slider-kvp]').textContent";
        assert_eq!(
            page.value(kvp).await,
            json!("Tube voltage 65 kV, from the technique")
        );
        page.pick("technique", "").await;

        // Each step has an address: back leads to the previous one.
        page.click("#tab-room").await;
        page.wait("document.querySelector('#room-facts').textContent.includes('Focal spot')")
            .await;
        let coverage = "document.getElementById('coverage').textContent";
        page.wait(&format!("{coverage}.includes('%')")).await;
        let scrolled = "document.querySelector('aside').scrollTop";
        assert_eq!(page.value(scrolled).await, json!(0));
        let planned = page.value(coverage).await;
        page.slide("camera-left-1", 300.0).await;
        page.wait(&format!("{coverage} !== {planned}")).await;
        page.picture("guide_room").await;
        page.click("#cameras-back").await;
        page.wait(&format!("{coverage} === {planned}")).await;
        page.client.back().await.unwrap();
        page.wait("document.body.dataset.step === 'whatif'").await;
        page.close().await;
    });
}
