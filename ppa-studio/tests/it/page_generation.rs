//! Step 6 of the page in Chromium: plan and generation.

use ppa_generate::Plan;
use serde_json::json;

use crate::chromium::{Page, run};
use crate::plan_cameras::write_files;
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

        // A field with the focus shows which numbers it accepts.
        page.click("[id='plan:soft_tissue.distal_mm']").await;
        page.wait("document.getElementById('plan:soft_tissue.distal_mm:hint').textContent.endsWith('Accepted: at least 0, at most 20.')")
            .await;
        page.picture("plan_limits").await;

        // A value refused by the plan is reported at its field.
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

        // A reload shows the state of the files, from which the run continues.
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

#[test]
#[ignore = "needs chromium and chromedriver"]
fn cameras_and_materials_are_chosen_and_written_out() {
    run(async {
        let folder = tempfile::tempdir().unwrap();
        let file = plan(folder.path());
        let rig = write_files(folder.path());
        let text = std::fs::read_to_string(folder.path().join("small.rig.json")).unwrap();
        std::fs::write(folder.path().join("cut.rig.json"), &text[..text.len() / 2]).unwrap();
        let page = Page::of(folder, &file).await;
        page.click("#tab-generation").await;
        let field = |key: &str| format!("document.getElementById('plan:{key}')");
        page.wait(&format!("!!{}", field("depth.rig"))).await;
        // An unreadable rig is named with the reason.
        page.wait(&format!(
            "/^cut.rig.json cannot be read: .*line 1/.test({}.textContent)",
            field("depth.rig:unreadable")
        ))
        .await;
        let open = "document.querySelectorAll('#plan-form details').forEach((group) => { group.open = true; })";
        page.client.execute(open, vec![]).await.unwrap();

        page.pick("plan:depth.rig", "small.rig.json").await;
        let edited = page.folder.path().join("ankles.edited.toml");
        page.until(|| edited.exists()).await;
        page.wait("!document.getElementById('plan-limbs').inert")
            .await;
        let place = "document.getElementById('plan:depth.rig').scrollIntoView()";
        page.client.execute(place, vec![]).await.unwrap();
        page.picture("plan_rig").await;

        page.pick("plan:depth.cameras.left.camera.model", "pinhole")
            .await;
        let refused = field("depth.cameras.left.camera.model:refused");
        page.wait(&format!(
            "{refused}.textContent.includes('pinhole with k1')"
        ))
        .await;
        page.fill("[id='plan:depth.cameras.left.camera.fx']", "260.5")
            .await;
        page.wait(&format!(
            "{}.selectedOptions[0].textContent.includes('depth.cameras')",
            field("depth.rig")
        ))
        .await;
        let cameras = Plan::read(&edited).unwrap().depth.cameras.unwrap();
        assert_eq!(cameras.left.camera.fx, 260.5);
        assert_eq!(cameras.right, rig.right);
        page.wait(&format!(
            "{}.value.split('\\n').length === 4",
            field("depth.cameras.left.device_from_camera")
        ))
        .await;
        page.picture("plan_cameras").await;
        // The page cannot remove a number that the plan requires.
        let standard = "document.querySelector(\"[aria-label='Default of depth.cameras.left.camera.fx']\").hidden";
        assert_eq!(page.value(standard).await, json!(true));
        page.click("#plan-undo").await;
        page.wait(&format!(
            "{}.value === 'small.rig.json'",
            field("depth.rig")
        ))
        .await;
        assert_eq!(Plan::read(&edited).unwrap().depth.cameras, None);

        page.pick("plan:xray.calibration_file", "water.toml").await;
        page.wait("document.getElementById('plan-materials').textContent.includes('water')")
            .await;
        let place = "document.getElementById('plan:xray.calibration_file').scrollIntoView()";
        page.client.execute(place, vec![]).await.unwrap();
        page.picture("plan_materials").await;
        page.client.set_window_size(600, 900).await.unwrap();
        page.client.execute(place, vec![]).await.unwrap();
        page.picture("plan_materials_narrow").await;
        let place = "document.getElementById('plan:depth.rig').scrollIntoView()";
        page.client.execute(place, vec![]).await.unwrap();
        page.picture("plan_cameras_narrow").await;
        page.click("[aria-label='Default of xray.calibration_file']")
            .await;
        page.wait("document.getElementById('plan-materials').textContent.includes('titanium')")
            .await;
        page.close().await;
    });
}
