//! Step 7 of the page in Chromium: a dataset.

use serde_json::json;

use crate::chromium::{Page, run};
use crate::plans::dataset;

#[test]
#[ignore = "needs chromium and chromedriver"]
fn an_outlier_is_shown_and_opened_in_its_pose() {
    run(async {
        let folder = tempfile::tempdir().unwrap();
        let root = dataset(folder.path());
        let page = Page::of(folder, &root).await;
        page.wait("document.body.dataset.step === 'dataset'").await;
        let count = "document.getElementById('dataset-count').textContent";
        page.wait(&format!(
            "{count} === '11 of 11 poses, 11 with a label, 1 outlier'"
        ))
        .await;
        assert_eq!(
            page.value("document.querySelectorAll('.chart').length")
                .await,
            json!(3)
        );
        assert_eq!(
            page.value("document.getElementById('tab-scan').disabled")
                .await,
            json!(true)
        );
        page.picture("dataset").await;

        page.fill("#filter-to", "10").await;
        page.wait(&format!(
            "{count} === '5 of 11 poses, 5 with a label, 0 outliers'"
        ))
        .await;
        page.fill("#filter-to", "\u{e017}").await; // delete
        page.wait(&format!("{count}.startsWith('11 of 11')")).await;

        page.click("[aria-label='Show patient 4 right, orig, 15.0°']")
            .await;
        page.wait("document.getElementById('pose').dataset.step === '30'")
            .await;
        page.picture("dataset_outlier").await;
        page.click("#dataset-check").await;
        page.wait(
            "document.getElementById('check-text').textContent.startsWith('22 depth images')",
        )
        .await;

        // A point of a chart is a pose; so is an angle that is typed.
        page.click(".chart .pose").await;
        page.wait("document.getElementById('pose').dataset.step === '0'")
            .await;
        page.fill("#pose-angle", "15.4").await;
        page.click("#pose-form button").await;
        page.wait("document.getElementById('pose').dataset.step === '30'")
            .await;
        page.click("#pose-open button").await;
        page.wait("document.body.dataset.step === 'whatif'").await;
        page.wait("document.getElementById('slider-angle_deg').value === '15'")
            .await;
        page.wait("document.querySelector('#radiograph').dataset.pass === 'final'")
            .await;
        page.picture("dataset_opened").await;
        page.client.back().await.unwrap();
        page.wait("document.body.dataset.step === 'dataset'").await;
        page.close().await;
    });
}
