//! Step 7 of the page in Chromium: a dataset.

use serde_json::json;

use crate::chromium::{Page, run};
use crate::page_access::{FAINT, NAMELESS};
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
        let grey = "(() => { const image = document.getElementById('pose-depth'); const { naturalWidth: w, naturalHeight: h } = image; \
                    const drawing = new OffscreenCanvas(w, h).getContext('2d'); drawing.drawImage(image, 0, 0); \
                    return drawing.getImageData(0, 0, w, h).data.reduce((sum, value) => sum + value, 0); })()";
        let complete = "document.getElementById('pose-depth').complete";
        page.wait(complete).await;
        let outlier = page.value(grey).await;
        page.click("#dataset-check").await;
        page.wait(
            "document.getElementById('check-text').textContent.startsWith('22 depth images')",
        )
        .await;

        // The series of the legend have different styles, and series of the same colour different shapes.
        let looks = "import('/page/charts.js').then(({ MOST_SERIES, styleOf }) => { \
                     const all = Array.from({ length: MOST_SERIES }, (_, n) => JSON.stringify(styleOf(n))); \
                     const shapes = new Set(Array.from({ length: MOST_SERIES / 8 }, (_, n) => styleOf(8 * n).shape)); \
                     return [new Set(all).size, shapes.size, styleOf(MOST_SERIES).colour === styleOf(0).colour]; })";
        assert_eq!(page.value(looks).await, json!([32, 4, true]));

        // Clicking a point of a chart or typing an angle selects a pose.
        page.click(".chart .pose").await;
        page.wait("document.getElementById('pose').dataset.step === '0'")
            .await;
        page.wait(complete).await;
        assert_ne!(page.value(grey).await, outlier);
        // A late image does not replace that of a later pose.
        page.delay_next("/api/dataset/depth").await;
        page.click(".chart .pose").await;
        page.fill("#pose-angle", "15.4").await;
        page.click("#pose-form button").await;
        page.wait("window.late").await;
        page.wait("document.getElementById('pose').dataset.step === '30'")
            .await;
        page.wait(complete).await;
        assert_eq!(page.value(grey).await, outlier);
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

#[test]
#[ignore = "needs chromium and chromedriver"]
fn a_reader_grades_by_keys_and_the_labels_follow() {
    run(async {
        let folder = tempfile::tempdir().unwrap();
        let root = dataset(folder.path());
        let file = folder.path().join("ankles-readers/grades_Anna.csv");
        let page = Page::of(folder, &root).await;
        page.click("#grading-open").await;
        let begin = async || {
            page.wait("document.getElementById('grading-folder').value === 'ankles-readers'")
                .await;
            page.fill("#grading-reader", "Anna").await;
            page.click("#grading-form button[type=submit]").await;
        };
        page.wait("document.body.dataset.step === 'grading'").await;
        assert_eq!(page.value(NAMELESS).await, json!([]));
        assert_eq!(page.value(FAINT).await, json!([]));
        page.picture("grading_step").await;
        begin().await;
        let place = "document.getElementById('grading-place').textContent";
        let shown = "document.getElementById('grading-picture').ariaBusy === 'false'";
        page.wait(&format!("{place} === 'Picture 1 of 13' && {shown}"))
            .await;
        assert_eq!(page.value(NAMELESS).await, json!([]));
        assert_eq!(page.value(FAINT).await, json!([]));
        page.picture("grading").await;

        // Q is 1.5; the next picture follows.
        page.press("q").await;
        page.wait(&format!("{place} === 'Picture 2 of 13' && {shown}"))
            .await;
        page.press("3").await;
        page.wait(&format!("{place} === 'Picture 3 of 13'")).await;
        page.press("\u{e012}").await; // arrow left
        page.press("\u{e012}").await;
        page.wait(&format!("{place} === 'Picture 1 of 13' && {shown}"))
            .await;
        let pressed = "document.querySelector('#grading-grades [aria-pressed=true]').textContent";
        assert_eq!(page.value(pressed).await, json!("1.5 (key Q)"));
        page.press("w").await;
        page.wait(&format!("{place} === 'Picture 2 of 13'")).await;
        let grades = || {
            let text = std::fs::read_to_string(&file).unwrap();
            let grades = text
                .lines()
                .skip(1)
                .map(|row| row.rsplit(',').next().unwrap().to_owned());
            grades.collect::<Vec<_>>()
        };
        assert_eq!(grades(), ["2.5", "3.0"]);

        // After a reload, the page is still that of a reader, who continues at the same picture.
        page.client.refresh().await.unwrap();
        begin().await;
        for n in 3..=13 {
            page.wait(&format!("{place} === 'Picture {n} of 13' && {shown}"))
                .await;
            page.click("#grading-grades button").await;
        }
        page.wait("document.getElementById('grading-done').textContent === '13 of 13 graded'")
            .await;
        page.click("#grading-end").await;
        let text = "document.getElementById('grading-text').textContent";
        page.wait(&format!("{text}.startsWith('13 of 13')")).await;
        page.wait(
            "document.getElementById('command-list').textContent.includes('ppa label import')",
        )
        .await;
        page.click("#grading-import").await;
        page.client.accept_alert().await.unwrap();
        page.wait(&format!(
            "{text} === '11 radiographs labelled by 1 reader; 0 keep computed labels, 0 have none'"
        ))
        .await;
        page.picture("grading_end").await;
        page.click("#tab-dataset").await;
        page.wait("document.querySelectorAll('.chart').length === 3")
            .await;
        page.click("[aria-label='Show patient 4 right, orig, 15.0°']")
            .await;
        page.wait("document.getElementById('pose-facts').textContent.includes('(readers)')")
            .await;
        page.picture("graded").await;
        page.close().await;
    });
}
