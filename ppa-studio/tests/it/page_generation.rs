//! Step 6 of the page in Chromium: plan and generation.

use ppa_generate::Plan;
use serde_json::json;

use crate::chromium::{Page, run};
use crate::plans::plan;

#[test]
#[ignore = "needs chromium and chromedriver"]
fn a_plan_is_changed_and_its_dataset_made() {
    run(async {
        let folder = tempfile::tempdir().unwrap();
        let file = plan(folder.path());
        let page = Page::of(folder, &file).await;
        page.click("#tab-generation").await;
        page.wait("document.getElementById('phase').textContent === 'Nothing is made yet.'")
            .await;
        page.picture("plan").await;

        // A value that the plan refuses is said at its field.
        page.fill("[id='plan:rotation.step_deg']", "0.3").await;
        let refused = "document.getElementById('plan:rotation.step_deg:refused').textContent";
        page.wait(&format!("{refused}.includes('step_deg')")).await;
        page.fill("[id='plan:rotation.step_deg']", "2.5").await;
        let edited = page.folder.path().join("ankles.edited.toml");
        page.wait(
            "document.getElementById('plan-file').textContent.includes('ankles.edited.toml')",
        )
        .await;
        assert_eq!(Plan::read(&edited).unwrap().rotation.step_deg, 2.5);
        page.click("[id='plan:shapes.variants:big']").await;
        page.until(|| Plan::read(&edited).unwrap().shapes.variants.len() == 2)
            .await;
        page.click("[aria-label='Default of rotation.step_deg']")
            .await;
        page.wait("document.getElementById('plan:rotation.step_deg').value === ''")
            .await;
        page.fill("[id='plan:rotation.step_deg']", "5").await;
        page.wait("document.getElementById('plan:rotation.step_deg').value === '5'")
            .await;

        page.click("#forecast").await;
        page.wait(
            "document.getElementById('forecast-facts').textContent.includes('24 depth images')",
        )
        .await;
        page.click("#generate").await;
        page.wait("Number(document.getElementById('progress').value) > 0")
            .await;
        page.wait("!!document.getElementById('sheet-image').src")
            .await;
        page.picture("generation").await;
        page.click("#pause").await;
        page.wait(
            "['Paused.', 'Complete.'].includes(document.getElementById('phase').textContent)",
        )
        .await;
        page.picture("generation_paused").await;
        page.wait("document.getElementById('command-list').textContent.includes('ppa generate')")
            .await;

        // A reload shows what the files hold; the run goes on from there.
        page.client.refresh().await.unwrap();
        page.wait(
            "['Paused.', 'Complete.'].includes(document.getElementById('phase').textContent)",
        )
        .await;
        // The run may have ended before it was paused.
        if page
            .value("!document.getElementById('generate').disabled")
            .await
            == json!(true)
        {
            page.click("#generate").await;
        }
        page.wait("document.getElementById('phase').textContent === 'Complete.'")
            .await;
        page.picture("generation_complete").await;
        page.close().await;
    });
}

#[test]
#[ignore = "needs chromium and chromedriver"]
fn a_limb_is_added_given_a_person_and_removed() {
    run(async {
        let folder = tempfile::tempdir().unwrap();
        let file = plan(folder.path());
        let case = |name: &str| folder.path().join(name);
        let text = std::fs::read_to_string(case("p01.case.toml")).unwrap();
        let text = text.replacen("side = \"r\"", "side = \"l\"", 1);
        std::fs::write(case("left.case.toml"), text).unwrap();
        let page = Page::of(folder, &file).await;
        page.click("#tab-generation").await;
        page.wait("!document.getElementById('plan-add').disabled")
            .await;
        page.click("#plan-add").await;
        page.wait("document.querySelectorAll('#plan-limbs li').length === 2")
            .await;
        page.picture("plan_limbs").await;
        page.fill("[aria-label='Patient of left.case.toml']", "7")
            .await;
        let edited = page.folder.path().join("ankles.edited.toml");
        page.until(|| Plan::read(&edited).unwrap().cases[1].patient == 7)
            .await;
        page.wait("!document.getElementById('plan-limbs').inert")
            .await;
        page.click("[aria-label='Remove p01.case.toml']").await;
        page.wait("document.querySelectorAll('#plan-limbs li').length === 1")
            .await;
        assert_eq!(Plan::read(&edited).unwrap().cases[0].patient, 7);
        page.close().await;
    });
}
