//! Step 8 of the page in Chromium: training runs and watched frames.

use ppa_studio::Opening;
use serde_json::json;

use crate::chromium::{Page, run};
use crate::live::{watching, write_frames};
use crate::networks::networks;
use crate::page_access::{FAINT, NAMELESS};
use crate::trainings::folder_of_trainings;

const ANSWER: &str = "document.getElementById('live-answer').textContent";

#[test]
#[ignore = "needs chromium and chromedriver"]
fn trainings_are_compared_and_their_errors_shown() {
    run(async {
        let folder = tempfile::tempdir().unwrap();
        folder_of_trainings(folder.path());
        let runs = folder.path().join("runs");
        let page = Page::of(folder, &runs).await;
        page.wait("document.body.dataset.step === 'training'").await;
        let count = "document.getElementById('training-count').textContent";
        page.wait(&format!(
            "{count} === '3 of 3 training runs, 2 finished, 1 running'"
        ))
        .await;
        let lines =
            "document.querySelectorAll('#training-charts figure:first-child polyline').length";
        page.wait(&format!("{lines} === 3")).await;
        page.click("[id='training-of-later/stopped']").await;
        page.wait(&format!("{lines} === 2")).await;
        // An active training run is followed.
        let log = page.folder.path().join("runs/later/stopped/log.jsonl");
        let row = r#"{"step":7,"seconds":0.5,"training/loss":0.125}"#;
        std::fs::write(log, format!("{row}\n")).unwrap();
        page.wait("document.getElementById('training-table').textContent.includes('7 of')")
            .await;
        for name in ["left", "right"] {
            page.click(&format!("[aria-label='Errors of {name}']"))
                .await;
            page.wait(&format!(
                "document.getElementById('worst-of').textContent === '{name}' \
                 && [...document.querySelectorAll('#worst img')].every((i) => i.naturalWidth === 50)"
            ))
            .await;
        }
        let rows = "document.querySelectorAll('#error-table tr').length";
        assert_eq!(page.value(rows).await, json!(3));
        page.picture("training").await;
        assert_eq!(page.value(NAMELESS).await, json!([]));
        assert_eq!(page.value(FAINT).await, json!([]));
        page.fill("#training-filter", "stop").await;
        page.wait(&format!("{count}.startsWith('1 of 3')")).await;
        page.close().await;
    });
}

#[test]
#[ignore = "needs chromium and chromedriver"]
fn more_than_eight_trainings_look_different() {
    run(async {
        let folder = tempfile::tempdir().unwrap();
        let runs = folder.path().join("runs");
        for number in 0..18 {
            let training = runs.join(format!("run-{number:02}"));
            std::fs::create_dir_all(&training).unwrap();
            std::fs::copy(
                networks().left.join("config.toml"),
                training.join("config.toml"),
            )
            .unwrap();
            let row = |step: i32| {
                let loss = (f64::from(number) + 2.0) / f64::from(step + 4);
                format!("{{\"step\":{step},\"seconds\":0.5,\"training/loss\":{loss}}}\n")
            };
            let log: String = (1..12).map(row).collect();
            std::fs::write(training.join("log.jsonl"), log).unwrap();
        }
        let page = Page::of(folder, &runs).await;
        let boxes = "document.querySelectorAll('#training-table input')";
        page.wait(&format!("{boxes}.length === 18")).await;
        let choose = "document.querySelectorAll('#training-table input').forEach((box) => { \
                      const now = document.getElementById(box.id); if (!now.checked) now.click(); })";
        page.client.execute(choose, vec![]).await.unwrap();
        let looks = "[...document.querySelectorAll('#training-charts figure:first-child polyline')] \
                     .map((line) => line.getAttribute('stroke') + line.getAttribute('stroke-dasharray'))";
        page.wait(&format!(
            "{looks}.length === 18 && new Set({looks}).size === 18"
        ))
        .await;
        page.picture("training_many").await;
        let place = "document.getElementById('training-charts').scrollIntoView()";
        page.client.execute(place, vec![]).await.unwrap();
        page.picture("training_many_charts").await;
        page.client.set_window_size(600, 900).await.unwrap();
        page.client.execute(place, vec![]).await.unwrap();
        page.picture("training_many_narrow").await;
        page.close().await;
    });
}

#[test]
#[ignore = "needs chromium and chromedriver"]
fn new_frames_are_shown_with_an_answer() {
    run(async {
        let folder = tempfile::tempdir().unwrap();
        let opening: Opening = watching(folder.path());
        let page = Page::opened(folder, &opening).await;
        page.wait(&format!("{ANSWER} === 'No frames yet'")).await;
        write_frames(page.folder.path(), "1", 0);
        // The answer itself is shown for three seconds only.
        page.wait("document.getElementById('live-facts').textContent.startsWith('1, pair 1')")
            .await;
        page.wait("document.getElementById('live-image').naturalWidth === 100")
            .await;
        page.picture("live").await;
        assert_eq!(page.value(NAMELESS).await, json!([]));
        assert_eq!(page.value(FAINT).await, json!([]));
        page.wait(&format!("{ANSWER} === 'No new frames'")).await;
        write_frames(page.folder.path(), "2", 50);
        page.wait("document.getElementById('live-facts').textContent.startsWith('2, pair 2')")
            .await;
        page.click("#tab-training").await;
        page.close().await;
    });
}

#[test]
#[ignore = "needs chromium and chromedriver"]
fn answers_tell_an_operator_what_to_do() {
    run(async {
        let folder = tempfile::tempdir().unwrap();
        let opening = watching(folder.path());
        let page = Page::opened(folder, &opening).await;
        for (prediction, expected) in [
            (json!({ "quality": 1.2 }), "Good"),
            (json!({ "quality": 2.5 }), "Not good"),
            (
                json!({ "quality": 2.8, "correction_deg": 6.4 }),
                "Rotate inwards by about 6°",
            ),
            (
                json!({ "quality": 2.8, "correction_deg": -12.0 }),
                "Rotate outwards by about 12°",
            ),
            (
                json!({ "quality": 2.3, "interval": [1.9, 2.7], "diagnostic": "not_sure" }),
                "Not sure",
            ),
            (
                json!({ "quality": 2.3, "interval": [2.0, 2.4], "diagnostic": "yes" }),
                "Good",
            ),
        ] {
            let answer = json!({ "prediction": prediction });
            let verdict =
                format!("import('/page/live.js').then((live) => live.verdict({answer})[0])");
            assert_eq!(page.value(&verdict).await, json!(expected), "{answer}");
        }
        let refused =
            "import('/page/live.js').then((live) => live.verdict({ refused: 'no limb' }))";
        assert_eq!(
            page.value(refused).await,
            json!(["Not judged", "no limb", "none"])
        );
        page.close().await;
    });
}
