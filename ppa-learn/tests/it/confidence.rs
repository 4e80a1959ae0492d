//! Prediction intervals and refusal of unlike frames, calibrated with persons who were not in the training data.

use std::path::{Path, PathBuf};

use ppa_core::Roi;
use ppa_learn::DeviceName;
use ppa_learn::data::Views;
use ppa_learn::frames::{Answer, Confidence, FramesError, PairPrediction, PairPredictor};
use ppa_learn::train::TrainConfig;
use tempfile::TempDir;

use crate::runs::{n, run, source};
use crate::toy::{IMAGE, dataset, png};

/// Depth of a pixel, in mm.
type Depth = fn(u32, u32) -> u16;

/// Bars at sixteen angles for thirteen persons, and a network trained on both views of five of them.
fn trained() -> (TempDir, TempDir) {
    let steps: Vec<u32> = (0..=180).step_by(12).collect();
    let data = dataset(13, &steps);
    let folder = tempfile::tempdir().unwrap();
    let config = TrainConfig {
        views: Views::Unified,
        side: 32,
        steps: 100,
        checkpoint_every: n(1000),
        training: source(data.path(), &[0, 2, 4, 6, 8]),
        evaluation: Vec::new(),
        ..TrainConfig::quick()
    };
    run(&config, folder.path()).unwrap();
    (data, folder)
}

fn calibrated(data: &Path, run: &Path) -> PathBuf {
    let persons = source(data, &[1, 3, 5, 7, 9, 11, 12]);
    let device = DeviceName::default();
    let (confidence, calibration) =
        Confidence::calibrate(run, None, &persons, 0.9, device).unwrap();
    println!("{calibration:?}");
    assert_eq!((calibration.persons, calibration.pairs), (7, 112));
    let left_out = calibration.coverage_of_left_out_persons.unwrap();
    assert!(left_out > 0.7, "{left_out}");
    let file = run.join("confidence.safetensors");
    confidence.write(&file).unwrap();
    file
}

fn predictor(run: &Path) -> PairPredictor {
    let region = Roi {
        x_start: 10,
        y_start: 5,
        size: 48,
    };
    let side = Some(ppa_core::Side::Right);
    PairPredictor::new(run, None, [region; 2], side, DeviceName::default()).unwrap()
}

#[test]
fn intervals_cover_a_new_person_and_odd_frames_are_refused() {
    let (data, run) = trained();
    let run = run.path();
    let without = predictor(run);
    let with = predictor(run).with_confidence(&calibrated(data.path(), run));
    let with = with.unwrap();
    let person = data.path().join("patient_10/depth/r/orig");
    let (mut judged, mut covered) = (0, 0);
    for n in 0..16 {
        let angle = 6.0 * f64::from(n);
        let frames =
            ["left", "right"].map(|v| person.join(format!("depth_cam_{v}_{angle:.1}.png")));
        let frames = frames.each_ref().map(PathBuf::as_path);
        let plain = without.predict(frames).unwrap();
        match with.predict(frames) {
            Ok(answer) => {
                let trust = answer.trust.unwrap();
                let [low, high] = trust.interval;
                judged += 1;
                covered += usize::from((low..=high).contains(&(1.0 + angle / 45.0)));
                let expected = if high < 2.5 {
                    Answer::Yes
                } else if low >= 2.5 {
                    Answer::No
                } else {
                    Answer::NotSure
                };
                assert_eq!(trust.diagnostic, expected);
                let answer = PairPrediction {
                    trust: None,
                    ..answer
                };
                assert_eq!(answer, plain);
            }
            Err(error) => println!("{angle}: {error}"),
        }
    }
    println!("{judged} judged, {covered} covered");
    // The person is like the calibration persons.
    assert!(judged >= 14 && covered >= 12, "{judged}, {covered}");

    let usual = person.join("depth_cam_left_48.0.png");
    let odd: [(&str, Depth); 4] = [
        ("wall", |_, _| 1200),
        ("nothing", |_, _| 0),
        ("stripes", |x, _| if x / 4 % 2 == 0 { 700 } else { 1200 }),
        (
            "dots",
            |x, y| if (x / 6 + y / 6) % 2 == 0 { 900 } else { 1200 },
        ),
    ];
    for (name, value) in odd {
        let frame = run.join(format!("{name}.png"));
        png(&frame, IMAGE, value);
        for frames in [[&*frame, &usual], [&usual, &frame]] {
            assert!(without.predict(frames).is_ok());
            match with.predict(frames) {
                Err(FramesError::OutOfDistribution {
                    frame: found,
                    distance,
                }) => {
                    println!("{name}: {distance}");
                    assert_eq!(found, frame);
                }
                other => panic!("{name}: {other:?}"),
            }
        }
    }
}
