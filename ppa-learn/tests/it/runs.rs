//! Small training runs on toy data.

use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use ppa_learn::data::{Augmentation, Views};
use ppa_learn::train::{Ended, Source, TrainConfig, TrainError, train};
use ppa_learn::{Fusion, FusionKind};

pub fn n(number: usize) -> NonZeroUsize {
    NonZeroUsize::new(number).unwrap()
}

pub fn source(data: &Path, patients: &[u32]) -> Vec<Source> {
    vec![Source {
        dataset: data.to_owned(),
        patients: Some(patients.to_vec()),
        shapes: None,
        every_pose: None,
        labels: None,
    }]
}

/// Few and small steps on person 0, evaluated on person 1.
pub fn config(data: &Path) -> TrainConfig {
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

pub fn run(config: &TrainConfig, folder: &Path) -> Result<Ended, TrainError> {
    train(config, folder, &AtomicBool::new(false), |_| {})
}

pub fn stop_after(config: &TrainConfig, folder: &Path, step: u64) -> Ended {
    let stop = AtomicBool::new(false);
    let report = |progress: &ppa_learn::train::Progress| {
        stop.store(progress.step == step, Ordering::Relaxed);
    };
    train(config, folder, &stop, report).unwrap()
}

/// A configuration in which only the position of crops is random.
pub fn by_heart(data: &Path) -> TrainConfig {
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

/// A configuration for both cameras' images, to be learned without dropout.
pub fn pairs(data: &Path, kind: FusionKind, shared_weights: bool) -> TrainConfig {
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
