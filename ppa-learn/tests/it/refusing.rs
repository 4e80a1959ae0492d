//! Invalid training runs: refused before anything is written, or stopped when they cannot continue.

use std::fs;

use ppa_learn::train::{TrainConfig, TrainError};

use crate::runs::{config, run, source, stop_after};
use crate::toy::dataset;

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
        error.contains("patient 0 would be in both training and evaluation"),
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
fn checkpoints_of_other_trainings_are_refused() {
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
    assert!(error(&other).contains("its configuration differs"));
    let bytes = fs::read(&checkpoint).unwrap();
    let place = bytes
        .windows(15)
        .position(|w| w == b"efficientnet_b0")
        .unwrap();
    let mut renamed = bytes.clone();
    renamed[place + 14] = b'7';
    fs::write(&checkpoint, &renamed).unwrap();
    assert!(error(&config).contains("it is for efficientnet_b7, expected efficientnet_b0"));
    for broken in [
        &bytes[..0],
        &bytes[..100],
        &bytes[..bytes.len() - 1],
        b"no tensors here",
    ] {
        fs::write(&checkpoint, broken).unwrap();
        assert!(error(&config).contains("is not a checkpoint of this training"));
    }
    fs::write(&checkpoint, &bytes).unwrap();
    run(&config, folder.path()).unwrap();
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
        error.ends_with(
            "weights.safetensors exists without a checkpoint to resume from; use another folder"
        ),
        "{error}"
    );
    assert_eq!(fs::read(&weights).unwrap(), b"of another training");
    assert!(!folder.path().join("config.toml").exists());
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
