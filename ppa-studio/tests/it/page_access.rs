//! Accessibility of the page: blindness, low vision and narrow screens.

use serde_json::json;

use crate::chromium::{Page, run};
use crate::plans::dataset;

const STEPS: [&str; 8] = [
    "scan",
    "skin",
    "landmarks",
    "room",
    "whatif",
    "generation",
    "dataset",
    "training",
];

/// Visible controls without a name for a screen reader.
pub const NAMELESS: &str = "[...document.querySelectorAll('button, input, select, canvas, progress, img, [role=group]')] \
    .filter((e) => e.checkVisibility() && !(e.tagName === 'IMG' && !e.src)) \
    .filter((e) => !(e.getAttribute('aria-label') || e.getAttribute('alt') || e.labels?.[0]?.textContent.trim() \
        || document.getElementById(e.getAttribute('aria-labelledby'))?.textContent.trim() \
        || (e.tagName === 'BUTTON' && e.textContent.trim()))) \
    .map((e) => e.outerHTML.slice(0, 120))";

/// Texts with a contrast to their background below 4.5 (WCAG 2.2, level AA), except in disabled controls.
pub const FAINT: &str = "(() => { \
    const parts = (colour) => colour.match(/[\\d.]+/g).map(Number); \
    const light = (colour) => parts(colour).slice(0, 3).map((v) => v / 255) \
        .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)) \
        .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0); \
    const ground = (e) => { \
        for (let at = e; at; at = at.parentElement) { \
            const colour = getComputedStyle(at).backgroundColor; \
            if ((parts(colour)[3] ?? 1) > 0.5) return colour; \
        } \
        return 'rgb(255, 255, 255)'; \
    }; \
    const own = (e) => [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim()); \
    return [...document.body.querySelectorAll('*')] \
        .filter((e) => own(e) && e.checkVisibility() && !e.closest(':disabled, svg, option')) \
        .map((e) => { const [a, b] = [light(getComputedStyle(e).color), light(ground(e))]; \
            return [(Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05), e.outerHTML.slice(0, 120)]; }) \
        .filter(([ratio]) => ratio < 4.5); })()";

/// Opens the page of a plan and its dataset.
async fn page_of_plan() -> Page {
    let folder = tempfile::tempdir().unwrap();
    dataset(folder.path());
    let plan = folder.path().join("ankles.toml");
    Page::of(folder, &plan).await
}

#[test]
#[ignore = "needs chromium and chromedriver"]
fn controls_have_names_and_texts_enough_contrast() {
    run(async {
        let page = page_of_plan().await;
        page.wait("document.querySelector('#skin-facts').textContent.includes('Points')")
            .await;
        for step in STEPS {
            page.click(&format!("#tab-{step}")).await;
            page.wait("document.getElementById('command-list').childElementCount > 0")
                .await;
            assert_eq!(page.value(NAMELESS).await, json!([]), "{step}");
            assert_eq!(page.value(FAINT).await, json!([]), "{step}");
        }
        page.close().await;
    });
}

#[test]
#[ignore = "needs chromium and chromedriver"]
fn a_narrow_page_scrolls_only_down() {
    run(async {
        let page = page_of_plan().await;
        page.client.set_window_size(500, 900).await.unwrap();
        for step in STEPS {
            page.click(&format!("#tab-{step}")).await;
            page.wait("document.getElementById('command-list').childElementCount > 0")
                .await;
            page.picture(&format!("narrow_{step}")).await;
            let beyond = "document.documentElement.scrollWidth - window.innerWidth";
            let beyond = page.value(beyond).await.as_f64().unwrap();
            assert!(beyond <= 0.0, "{step}: {beyond}");
        }
        page.close().await;
    });
}

/// axe-core, in the file named by `PPA_AXE`, must find no violation of WCAG 2.2, levels A and AA, or of its best practices.
#[test]
#[ignore = "needs chromium, chromedriver and axe-core"]
fn axe_core_finds_nothing_against_the_page() {
    let file = std::env::var_os("PPA_AXE").expect("PPA_AXE names axe.min.js");
    let axe = std::fs::read_to_string(file).unwrap();
    run(async {
        let page = page_of_plan().await;
        page.wait("document.querySelector('#skin-facts').textContent.includes('Points')")
            .await;
        page.client.execute(&axe, vec![]).await.unwrap();
        let check = "const done = arguments[0]; \
            axe.run(document, { resultTypes: ['violations'] }) \
                .then((found) => done(found.violations.flatMap(({ id, help, nodes }) => nodes.map((n) => `${id}: ${help}: ${n.html.slice(0, 160)}`))), \
                    (error) => done([String(error)]));";
        let mut against = Vec::new();
        for step in STEPS {
            page.click(&format!("#tab-{step}")).await;
            page.wait("document.getElementById('command-list').childElementCount > 0")
                .await;
            let found = page.client.execute_async(check, vec![]).await.unwrap();
            let found: Vec<String> = serde_json::from_value(found).unwrap();
            against.extend(found.into_iter().map(|one| format!("{step}: {one}")));
        }
        assert!(against.is_empty(), "{}", against.join("\n"));
        page.close().await;
    });
}
