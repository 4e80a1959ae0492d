//! Trainings on toy data: they learn, go on where they were stopped, and refuse what cannot be.

use std::fs;
use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use cpu_time::ProcessTime;
use ppa_learn::data::{Augmentation, Views};
use ppa_learn::train::{
    Ended, Layers, Source, TrainConfig, TrainError, read_log, read_start, train,
};
use ppa_learn::{Fusion, FusionKind};

use crate::toy::dataset;

fn n(number: usize) -> NonZeroUsize {
    NonZeroUsize::new(number).unwrap()
}

fn source(data: &Path, patients: &[u32]) -> Vec<Source> {
    vec![Source {
        dataset: data.to_owned(),
        patients: Some(patients.to_vec()),
        shapes: None,
    }]
}

/// Few and small steps on person 0, evaluated on person 1.
fn config(data: &Path) -> TrainConfig {
    TrainConfig {
        side: 32,
        steps: 6,
        batch_size: n(4),
        log_every: n(1),
        checkpoint_every: n(2),
        training: source(data, &[0]),
        evaluation: source(data, &[1]),
        ..TrainConfig::quick()
    }
}

fn run(config: &TrainConfig, folder: &Path) -> Result<Ended, TrainError> {
    train(config, folder, &AtomicBool::new(false), |_| {})
}

fn stop_after(config: &TrainConfig, folder: &Path, step: u64) -> Ended {
    let stop = AtomicBool::new(false);
    let report = |progress: &ppa_learn::train::Progress| {
        stop.store(progress.step == step, Ordering::Relaxed);
    };
    train(config, folder, &stop, report).unwrap()
}

#[test]
fn a_training_that_was_stopped_ends_with_the_same_bytes() {
    let data = dataset(2, &[0, 90, 180]);
    let folders = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let [whole, parts] = folders.each_ref().map(|folder| folder.path().join("run"));
    let config = config(data.path());
    assert_eq!(run(&config, &whole).unwrap(), Ended::Finished);
    // Stopped beside and at a checkpoint; other workers and memory make no difference.
    assert_eq!(stop_after(&config, &parts, 3), Ended::Stopped { step: 3 });
    assert!(!parts.join("weights.safetensors").exists());
    let other = TrainConfig {
        workers: n(1),
        keep_mb: 0,
        ..config.clone()
    };
    assert_eq!(stop_after(&other, &parts, 4), Ended::Stopped { step: 4 });
    // What a crash leaves behind the checkpoint: rows of steps to be made again, and half a line.
    let log = parts.join("log.jsonl");
    let mut text = fs::read_to_string(&log).unwrap();
    text += "{\"step\":5,\"seconds\":1.0,\"training/loss\":0.0}\n{\"step\":6,\"sec";
    fs::write(&log, text).unwrap();
    assert_eq!(run(&config, &parts).unwrap(), Ended::Finished);
    for file in ["weights.safetensors", "checkpoint.safetensors"] {
        let [whole, parts] = [&whole, &parts].map(|folder| fs::read(folder.join(file)).unwrap());
        assert!(whole == parts, "{file}");
    }
    let scalars = |folder: &Path| {
        let rows = read_log(&folder.join("log.jsonl")).unwrap();
        let rows = rows.into_iter().map(|row| (row.step, row.scalars));
        rows.collect::<Vec<_>>()
    };
    // Six steps and three evaluations.
    assert_eq!(scalars(&whole).len(), 6 + 3);
    assert_eq!(scalars(&whole), scalars(&parts));
    // A finished training stays as it is.
    assert_eq!(run(&config, &parts).unwrap(), Ended::Finished);
}

/// A training in which nothing but the place of crops is random.
fn by_heart(data: &Path) -> TrainConfig {
    TrainConfig {
        steps: 160,
        batch_size: n(8),
        log_every: n(10),
        checkpoint_every: n(1000),
        evaluation: Vec::new(),
        augmentation: Augmentation {
            noise_probability: 0.0,
            invalid_probability: 0.0,
            ..TrainConfig::quick().augmentation
        },
        ..config(data)
    }
}

/// The median of the last five losses that were logged; single batches scatter, as crops stay random.
fn last_loss(folder: &Path) -> f64 {
    let log = read_log(&folder.join("log.jsonl")).unwrap();
    let losses: Vec<f64> = log.iter().map(|row| row.scalars["training/loss"]).collect();
    println!("{losses:?}");
    let mut last = losses[losses.len() - 5..].to_vec();
    last.sort_by(f64::total_cmp);
    last[2]
}

#[test]
fn one_batch_can_be_learned_by_heart() {
    let data = dataset(1, &[0, 60, 120, 180]);
    let folder = tempfile::tempdir().unwrap();
    run(&by_heart(data.path()), folder.path()).unwrap();
    // Labels spread by 0.55 about their mean, which a constant loses at best.
    assert!(last_loss(folder.path()) < 0.1);
}

/// Both cameras' images, to be learned without dropout.
fn pairs(data: &Path, kind: FusionKind, shared_weights: bool) -> TrainConfig {
    TrainConfig {
        views: Views::Pairs,
        fusion: Fusion {
            kind,
            shared_weights,
            late_dropout: 0.0,
            ..Fusion::default()
        },
        batch_size: n(4),
        ..by_heart(data)
    }
}

#[test]
fn a_training_on_pairs_that_was_stopped_ends_with_the_same_bytes() {
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
#[ignore = "half a minute of processor time"]
fn pairs_of_images_are_learned_by_heart() {
    let data = dataset(1, &[0, 60, 120, 180]);
    let folder = tempfile::tempdir().unwrap();
    let config = TrainConfig {
        steps: 100,
        ..pairs(data.path(), FusionKind::Late, false)
    };
    run(&config, folder.path()).unwrap();
    // A constant loses 0.55 at best; a step in three goes without one of the cameras.
    let loss = last_loss(folder.path());
    assert!(loss < 0.2, "{loss}");
}

#[test]
#[ignore = "measures processor time, alone: five seconds of it"]
fn probing_takes_less_than_a_tenth_of_the_time_of_training() {
    let steps: Vec<u32> = (0..=180).step_by(12).collect();
    let data = dataset(2, &steps);
    let seconds = |layers| {
        let config = TrainConfig {
            layers,
            steps: 40,
            training: source(data.path(), &[0, 1]),
            evaluation: Vec::new(),
            checkpoint_every: n(1000),
            ..TrainConfig::quick()
        };
        let folder = tempfile::tempdir().unwrap();
        let start = ProcessTime::now();
        run(&config, folder.path()).unwrap();
        start.elapsed().as_secs_f64()
    };
    let [all, last] = [Layers::All, Layers::Last].map(seconds);
    println!("40 steps of 16 images, 32 of them: {all:.2} s, probing {last:.2} s");
    assert!(10.0 * last < all, "{all} s, probing {last} s");
}

#[test]
fn a_person_on_both_sides_stops_before_anything_is_written() {
    let data = dataset(2, &[0, 90]);
    let folder = tempfile::tempdir().unwrap();
    let leaking = TrainConfig {
        evaluation: source(data.path(), &[1, 0]),
        ..config(data.path())
    };
    let error = run(&leaking, &folder.path().join("run"))
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("patient 0 would be in training and in evaluation"),
        "{error}"
    );
    assert!(!folder.path().join("run").exists());
}

#[test]
fn numbers_that_are_not_finite_stop_with_step_and_layer() {
    let data = dataset(2, &[0, 90, 180]);
    let folder = tempfile::tempdir().unwrap();
    let config = TrainConfig {
        learning_rate: 1e38,
        ..config(data.path())
    };
    let error = run(&config, folder.path()).unwrap_err();
    let TrainError::NotFinite { step, .. } = &error else {
        panic!("{error}")
    };
    assert!((1..6).contains(step));
    let text = error.to_string();
    assert!(
        text.starts_with("step ") && text.contains("features."),
        "{text}"
    );
}

#[test]
fn checkpoints_of_other_trainings_networks_and_files_are_refused() {
    let data = dataset(2, &[0, 90, 180]);
    let folder = tempfile::tempdir().unwrap();
    let config = config(data.path());
    stop_after(&config, folder.path(), 1);
    let checkpoint = folder.path().join("checkpoint.safetensors");
    let error = |config: &TrainConfig| run(config, folder.path()).unwrap_err().to_string();
    let other = TrainConfig {
        seed: 2,
        ..config.clone()
    };
    assert!(error(&other).contains("its configuration is another one"));
    let bytes = fs::read(&checkpoint).unwrap();
    let place = bytes
        .windows(15)
        .position(|w| w == b"efficientnet_b0")
        .unwrap();
    let mut renamed = bytes.clone();
    renamed[place + 14] = b'7';
    fs::write(&checkpoint, &renamed).unwrap();
    assert!(error(&config).contains("it is of efficientnet_b7, expected efficientnet_b0"));
    for broken in [
        &bytes[..0],
        &bytes[..100],
        &bytes[..bytes.len() - 1],
        b"no tensors here",
    ] {
        fs::write(&checkpoint, broken).unwrap();
        assert!(error(&config).contains("is no checkpoint of this training"));
    }
    fs::write(&checkpoint, &bytes).unwrap();
    run(&config, folder.path()).unwrap();
}

#[test]
fn a_training_goes_on_with_the_data_it_began_with_only() {
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
    assert!(error().contains("since: labels differ; take another folder"));
    let regions = replaced("roi_depth.json", "\"size\":48", "\"size\":47");
    assert!(error().contains("since: labels, regions of interest differ"));
    fs::write(lists.join("labels.json"), labels).unwrap();
    fs::write(lists.join("roi_depth.json"), regions).unwrap();
    let image = data.path();
    let image = image.join("patient_0/depth/r/orig/depth_cam_left_45.0.png");
    let away = image.with_extension("away");
    fs::rename(&image, &away).unwrap();
    assert!(error().contains("there are 2 training samples, it had 3"));
    fs::rename(&away, &image).unwrap();
    assert_eq!(run(&config, folder.path()).unwrap(), Ended::Finished);
}

#[test]
fn weights_without_a_checkpoint_are_not_written_over() {
    let data = dataset(2, &[0, 90, 180]);
    let folder = tempfile::tempdir().unwrap();
    let weights = folder.path().join("weights.safetensors");
    fs::write(&weights, "of another training").unwrap();
    let error = run(&config(data.path()), folder.path()).unwrap_err();
    let error = error.to_string();
    assert!(
        error.ends_with("weights.safetensors is there, but no checkpoint beside it to go on from; take another folder"),
        "{error}"
    );
    assert_eq!(fs::read(&weights).unwrap(), b"of another training");
    assert!(!folder.path().join("config.toml").exists());
}

/// The first step of a training that goes on after an image, damaged behind its first step, had ended it and was mended.
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
    // Of the evaluation, after two steps.
    let folder = tempfile::tempdir().unwrap();
    let step = first_step_after(&config, folder.path(), &image(1));
    assert_eq!(step, 3);
    // Of the training, whose next batches are loaded before.
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
fn an_evaluation_that_failed_is_made_up_when_the_training_goes_on() {
    let data = dataset(2, &[90]);
    let image = data
        .path()
        .join("patient_1/depth/r/orig/depth_cam_left_45.0.png");
    let whole = fs::read(&image).unwrap();
    for steps in [2, 3] {
        // After the last step, and after one before.
        let config = TrainConfig {
            steps,
            ..config(data.path())
        };
        let folder = tempfile::tempdir().unwrap();
        fs::write(&image, "no image").unwrap();
        let error = run(&config, folder.path()).unwrap_err();
        assert!(matches!(error, TrainError::Data(_)), "{error}");
        fs::write(&image, &whole).unwrap();
        assert_eq!(run(&config, folder.path()).unwrap(), Ended::Finished);
        let evaluated = |folder: &Path| {
            let rows = read_log(&folder.join("log.jsonl")).unwrap().into_iter();
            let rows = rows.filter(|row| row.scalars.contains_key("evaluation/mae"));
            rows.map(|row| (row.step, row.scalars)).collect::<Vec<_>>()
        };
        let events = fs::read(folder.path().join("events.out.tfevents.ppa")).unwrap();
        assert!(events.windows(14).any(|bytes| bytes == b"evaluation/mae"));
        let other = tempfile::tempdir().unwrap();
        run(&config, other.path()).unwrap();
        assert_eq!(evaluated(folder.path()), evaluated(other.path()));
        assert_eq!(evaluated(folder.path())[0].0, 2);
    }
}

#[test]
fn what_a_start_file_lacks_or_has_beyond_the_network_is_told_by_name() {
    let data = dataset(2, &[90]);
    let folder = tempfile::tempdir().unwrap();
    let before = folder.path().join("before");
    let config = TrainConfig {
        steps: 1,
        ..config(data.path())
    };
    run(&config, &before).unwrap();
    assert_eq!(read_start(&before).unwrap(), None);
    let config = TrainConfig {
        start: Some(before.join("checkpoint.safetensors")),
        ..pairs(data.path(), FusionKind::Late, true)
    };
    let after = folder.path().join("after");
    stop_after(&config, &after, 1);
    let told = read_start(&after).unwrap().unwrap();
    let moments = [
        "adam.first.0",
        "adam.first.1",
        "adam.second.0",
        "adam.second.1",
    ];
    assert_eq!(told.unused, moments);
    let kept: Vec<&str> = told
        .kept
        .iter()
        .map(|c| c.split(' ').next().unwrap())
        .collect();
    let layers = ["fc.0.weight", "fc.0.bias", "fc.3.weight", "fc.3.bias"];
    assert_eq!(kept[..4], layers);
    assert_eq!(kept[4..], ["classifier.1.weight", "classifier.1.bias"]);
}

#[cfg(unix)]
#[test]
fn a_path_that_is_not_utf8_is_an_error() {
    use std::os::unix::ffi::OsStrExt;
    let data = dataset(2, &[90]);
    let folder = tempfile::tempdir().unwrap();
    let config = TrainConfig {
        start: Some(std::ffi::OsStr::from_bytes(b"K\xf6ln").into()),
        ..config(data.path())
    };
    let error = run(&config, folder.path()).unwrap_err().to_string();
    assert!(error.contains("cannot be written as TOML"), "{error}");
}

#[test]
fn a_value_that_is_not_finite_does_not_end_the_log() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.jsonl");
    let lines = [(1, "0.5"), (2, "null"), (3, "0.25")].map(|(step, mae)| {
        format!("{{\"step\":{step},\"seconds\":1.5,\"evaluation/mae\":{mae}}}\n")
    });
    fs::write(&path, lines.concat()).unwrap();
    let rows = read_log(&path).unwrap();
    let values: Vec<f64> = rows
        .iter()
        .map(|row| row.scalars["evaluation/mae"])
        .collect();
    assert!(values.len() == 3 && values[1].is_nan(), "{values:?}");
    assert_eq!([values[0], values[2]], [0.5, 0.25]);
}

/// Bars at sixteen angles, five persons to learn from and one to judge by: a constant 2 is wrong by 0.53 on average.
fn bars(change: impl FnOnce(TrainConfig) -> TrainConfig) -> f64 {
    let steps: Vec<u32> = (0..=180).step_by(12).collect();
    let data = dataset(6, &steps);
    let folder = tempfile::tempdir().unwrap();
    let config = change(TrainConfig {
        log_every: n(25),
        checkpoint_every: n(1000),
        training: source(data.path(), &[0, 1, 2, 3, 5]),
        evaluation: source(data.path(), &[4]),
        ..TrainConfig::quick()
    });
    run(&config, folder.path()).unwrap();
    let log = read_log(&folder.path().join("log.jsonl")).unwrap();
    println!("{log:?}");
    log.last().unwrap().scalars["evaluation/mae"]
}

#[test]
fn the_angle_of_a_bar_is_learned_from_other_bars() {
    let mae = bars(|quick| TrainConfig {
        side: 32,
        steps: 100,
        ..quick
    });
    assert!(mae < 0.45, "{mae}");
}

#[test]
#[ignore = "trains for half a minute of processor time"]
fn quick_learns_as_it_is() {
    let mae = bars(|quick| quick);
    assert!(mae < 0.25, "{mae}");
}
