//! Training runs that resume after they were stopped, failed or were killed.

use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use ppa_learn::FusionKind;
use ppa_learn::train::{Ended, TrainConfig, TrainError, read_log, train};

use crate::runs::{config, n, pairs, run, stop_after};
use crate::toy::dataset;

#[test]
fn a_training_that_was_stopped_ends_with_the_same_bytes() {
    let data = dataset(2, &[0, 90, 180]);
    let folders = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let [whole, parts] = folders.each_ref().map(|folder| folder.path().join("run"));
    let config = config(data.path());
    assert_eq!(run(&config, &whole).unwrap(), Ended::Finished);
    // Stopped between checkpoints and at one; other workers and memory make no difference.
    assert_eq!(stop_after(&config, &parts, 3), Ended::Stopped { step: 3 });
    assert!(!parts.join("weights.safetensors").exists());
    let other = TrainConfig {
        workers: n(1),
        keep_mb: 0,
        ..config.clone()
    };
    assert_eq!(stop_after(&other, &parts, 4), Ended::Stopped { step: 4 });
    // Log entries of a crash after the checkpoint: rows of steps to be repeated, and half a line.
    let log = parts.join("log.jsonl");
    let mut text = fs::read_to_string(&log).unwrap();
    text += "{\"step\":5,\"seconds\":1.0,\"training/loss\":0.0}\n{\"step\":6,\"sec";
    fs::write(&log, text).unwrap();
    assert_eq!(run(&config, &parts).unwrap(), Ended::Finished);
    for file in ["weights.safetensors", "checkpoint.safetensors"] {
        let [whole, parts] = [&whole, &parts].map(|folder| fs::read(folder.join(file)).unwrap());
        assert!(whole == parts, "{file}");
    }
    // As text: correlations that are not defined are NaN.
    let scalars = |folder: &Path| {
        let rows = read_log(&folder.join("log.jsonl")).unwrap().into_iter();
        let rows = rows.map(|row| format!("{} {:?}", row.step, row.scalars));
        rows.collect::<Vec<_>>()
    };
    // Six steps and three evaluations.
    assert_eq!(scalars(&whole).len(), 6 + 3);
    assert_eq!(scalars(&whole), scalars(&parts));
    // A finished training run stays unchanged.
    assert_eq!(run(&config, &parts).unwrap(), Ended::Finished);
}

#[test]
fn averages_and_statistics_are_the_same_after_a_stop() {
    let data = dataset(2, &[0, 90, 180]);
    let folders = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let [whole, parts] = folders.each_ref().map(|folder| folder.path());
    let plain = config(data.path());
    let averaged = TrainConfig {
        weight_average: 0.9,
        recompute_statistics: 2,
        ..plain.clone()
    };
    run(&averaged, whole).unwrap();
    // Evaluations do not change the weights either.
    let rarely = TrainConfig {
        checkpoint_every: n(5),
        evaluation: Vec::new(),
        ..averaged.clone()
    };
    let elsewhere = tempfile::tempdir().unwrap();
    run(&rarely, elsewhere.path()).unwrap();
    assert_eq!(stop_after(&averaged, parts, 3), Ended::Stopped { step: 3 });
    run(&averaged, parts).unwrap();
    let checkpoint = |folder: &Path| fs::read(folder.join("checkpoint.safetensors")).unwrap();
    assert!(checkpoint(whole) == checkpoint(parts));
    let weights = |folder: &Path| fs::read(folder.join("weights.safetensors")).unwrap();
    assert!(weights(whole) == weights(parts));
    assert!(weights(whole) == weights(elsewhere.path()));
    // Training itself is not affected: the losses are those without an average.
    let other = tempfile::tempdir().unwrap();
    run(&plain, other.path()).unwrap();
    assert!(weights(whole) != weights(other.path()));
    let losses = |folder: &Path| {
        let rows = read_log(&folder.join("log.jsonl")).unwrap().into_iter();
        rows.filter_map(|row| row.scalars.get("training/loss").copied())
            .collect::<Vec<_>>()
    };
    assert_eq!(losses(whole), losses(other.path()));
}

#[test]
fn a_stopped_training_on_pairs_ends_with_the_same_bytes() {
    let data = dataset(1, &[0, 180]);
    let config = TrainConfig {
        steps: 2,
        ..pairs(data.path(), FusionKind::Late, true)
    };
    let folders = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let [whole, parts] = folders.each_ref().map(|folder| folder.path());
    run(&config, whole).unwrap();
    assert_eq!(stop_after(&config, parts, 1), Ended::Stopped { step: 1 });
    run(&config, parts).unwrap();
    let [whole, parts] = [whole, parts].map(|f| fs::read(f.join("weights.safetensors")).unwrap());
    assert!(whole == parts);
}

#[test]
fn a_training_resumes_with_the_data_it_began_with_only() {
    let data = dataset(2, &[0, 90, 180]);
    let folder = tempfile::tempdir().unwrap();
    let config = config(data.path());
    stop_after(&config, folder.path(), 1);
    let error = || run(&config, folder.path()).unwrap_err().to_string();
    let lists = data.path().join("patient_0/labels/r");
    let replaced = |file: &str, from: &str, to: &str| {
        let text = fs::read_to_string(lists.join(file)).unwrap();
        assert!(text.contains(from), "{text}");
        fs::write(lists.join(file), text.replace(from, to)).unwrap();
        text
    };
    let labels = replaced("labels.json", "\"label\":2.0", "\"label\":2.5");
    assert!(error().contains("since: labels differ; use another folder"));
    let regions = replaced("roi_depth.json", "\"size\":48", "\"size\":47");
    assert!(error().contains("since: labels, regions of interest differ"));
    fs::write(lists.join("labels.json"), labels).unwrap();
    fs::write(lists.join("roi_depth.json"), regions).unwrap();
    let image = data.path();
    let image = image.join("patient_0/depth/r/orig/depth_cam_left_45.0.png");
    let away = image.with_extension("away");
    fs::rename(&image, &away).unwrap();
    assert!(error().contains("there are 2 training samples, but it was written with 3"));
    fs::rename(&away, &image).unwrap();
    assert_eq!(run(&config, folder.path()).unwrap(), Ended::Finished);
}

/// First step of a training run that resumes after an image, damaged after the first step, stopped it and was repaired.
fn first_step_after(config: &TrainConfig, folder: &Path, image: &Path) -> u64 {
    let whole = fs::read(image).unwrap();
    let damage = |_: &ppa_learn::train::Progress| fs::write(image, "no image").unwrap();
    let error = train(config, folder, &AtomicBool::new(false), damage).unwrap_err();
    assert!(matches!(error, TrainError::Data(_)), "{error}");
    fs::write(image, whole).unwrap();
    let mut first = None;
    let stop = AtomicBool::new(true);
    let report = |progress: &ppa_learn::train::Progress| {
        first.get_or_insert(progress.step);
    };
    train(config, folder, &stop, report).unwrap();
    first.unwrap()
}

#[test]
fn an_image_that_cannot_be_used_costs_no_steps() {
    let data = dataset(2, &[90]);
    let image = |patient: u32| {
        let image = format!("patient_{patient}/depth/r/orig/depth_cam_left_45.0.png");
        data.path().join(image)
    };
    let config = TrainConfig {
        steps: 40,
        workers: n(1),
        keep_mb: 0,
        ..config(data.path())
    };
    // An evaluation image, after two steps.
    let folder = tempfile::tempdir().unwrap();
    let step = first_step_after(&config, folder.path(), &image(1));
    assert_eq!(step, 3);
    // A training image; the next batches were already loaded.
    let folder = tempfile::tempdir().unwrap();
    let config = TrainConfig {
        checkpoint_every: n(1000),
        ..config
    };
    let step = first_step_after(&config, folder.path(), &image(0));
    let log = read_log(&folder.path().join("log.jsonl")).unwrap();
    let steps: Vec<u64> = log.iter().map(|row| row.step).collect();
    assert!(step > 1);
    assert_eq!(steps, (1..=step).collect::<Vec<_>>());
}

#[test]
fn a_failed_evaluation_is_repeated_on_resume() {
    let data = dataset(2, &[90]);
    let image = data
        .path()
        .join("patient_1/depth/r/orig/depth_cam_left_45.0.png");
    let whole = fs::read(&image).unwrap();
    for steps in [2, 3] {
        // After the last step, and after one before.
        let config = TrainConfig {
            steps,
            keep_mb: 0,
            ..config(data.path())
        };
        let folder = tempfile::tempdir().unwrap();
        let damage = |_: &ppa_learn::train::Progress| fs::write(&image, "no image").unwrap();
        let never = AtomicBool::new(false);
        let error = train(&config, folder.path(), &never, damage).unwrap_err();
        assert!(matches!(error, TrainError::Data(_)), "{error}");
        fs::write(&image, &whole).unwrap();
        assert_eq!(run(&config, folder.path()).unwrap(), Ended::Finished);
        let evaluated = |folder: &Path| {
            let rows = read_log(&folder.join("log.jsonl")).unwrap().into_iter();
            let rows = rows.filter(|row| row.scalars.contains_key("evaluation/mae"));
            rows.map(|row| (row.step, format!("{:?}", row.scalars)))
                .collect::<Vec<_>>()
        };
        let events = fs::read(folder.path().join("events.out.tfevents.ppa")).unwrap();
        assert!(events.windows(14).any(|bytes| bytes == b"evaluation/mae"));
        let other = tempfile::tempdir().unwrap();
        run(&config, other.path()).unwrap();
        assert_eq!(evaluated(folder.path()), evaluated(other.path()));
        assert_eq!(evaluated(folder.path())[0].0, 2);
    }
}
