//! The training loop.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use ppa_dataset::{Manifest, write_whole};

use crate::data::{Balanced, Images, check_split};

use super::adam::Adam;
use super::average::Average;
use super::batch_source::BatchSource;
use super::checkpoint;
use super::config::TrainConfig;
use super::config_error::ConfigError;
use super::data_state::DataState;
use super::error::{TrainError, at};
use super::log::Log;
use super::start_file;
use super::steps::{Run, is_due};
use super::trained::{network, samples};

/// Training progress, reported after every step.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// Number of steps made.
    pub step: u64,
    /// Total number of steps.
    pub steps: u64,
    /// Loss of the step's batch: the mean squared error of the quality plus the weighted one of corrections.
    pub loss: f32,
    /// Learning rate of the step.
    pub learning_rate: f64,
}

/// Outcome of a training run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// All steps are made.
    Finished,
    /// It was stopped on request; the checkpoint holds the steps made so far.
    Stopped {
        /// Number of steps made.
        step: u64,
    },
}

/// Trains according to a configuration in a folder; resumes from the folder's checkpoint, if there is one, with the same bytes
/// as a training run that was never stopped.
///
/// # Errors
/// [`TrainError`]. If an image is the cause, the checkpoint holds all steps made before; otherwise it is the last complete one.
pub fn train(
    config: &TrainConfig,
    folder: &Path,
    stop: &AtomicBool,
    mut report: impl FnMut(&Progress),
) -> Result<Ended, TrainError> {
    config.check()?;
    if folder.join(Manifest::FILE).exists() {
        return Err(TrainError::Dataset(folder.to_owned()));
    }
    let device = config.device.open()?;
    let training = samples(config, &config.training)?;
    let evaluation = samples(config, &config.evaluation)?;
    check_split(&training, &evaluation)?;
    if config.correction_weight > 0.0 && training.iter().all(|s| s.correction_deg.is_none()) {
        return Err(TrainError::NoCorrection);
    }
    let echoed = toml::to_string(config).map_err(|e| ConfigError::Write(e.to_string()))?;
    Balanced::new(&training)?; // Finds labels outside the scale before training.
    if !evaluation.is_empty() {
        Balanced::new(&evaluation)?;
    }

    let network = network(config)?.to_device(&device)?;
    let checkpoint = folder.join("checkpoint.safetensors");
    let data = DataState::of(&training);
    let (adam, average) = if checkpoint.exists() {
        checkpoint::load(&checkpoint, &network, config, &data)?
    } else {
        let weights = folder.join("weights.safetensors");
        if weights.exists() {
            return Err(TrainError::WeightsAlone(weights));
        }
        let path = folder.join("config.toml");
        if path.exists() && std::fs::read(&path).map_err(at("read", &path))? != echoed.as_bytes() {
            return Err(TrainError::OtherConfig(path));
        }
        if let Some(start) = &config.start {
            let loaded = network.load(start, config.first_convolution)?;
            start_file::write(folder, &loaded)?;
        }
        let variables = network.variables();
        let average = (config.weight_average > 0.0).then(|| Average::new(&variables));
        (Adam::new(&variables)?, average.transpose()?)
    };
    write_whole(&folder.join("config.toml"), echoed.as_bytes())?;
    let log = Log::resume(&folder.join("log.jsonl"), adam.steps)?;
    let keep_bytes = config.keep_mb.saturating_mul(1_000_000);
    let mut run = Run {
        config,
        folder,
        data,
        network,
        adam,
        average,
        seconds_before: log.rows.last().map_or(0.0, |row| row.seconds),
        log,
        started: Instant::now(),
        training: Arc::new(Images::new(training, config.side, keep_bytes)?),
        evaluation: match evaluation.is_empty() {
            true => None,
            false => Some(Arc::new(Images::new(evaluation, config.side, keep_bytes)?)),
        },
    };
    let mut batches = BatchSource::new(config, &run.network, &run.training, run.adam.steps)?;
    let steps = config.schedule().steps();
    run.make_up_evaluation()?;
    while run.adam.steps < steps {
        let outputs = match batches.outputs(config, &run.network, run.adam.steps) {
            // An unusable image does not lose completed steps.
            Err(error @ TrainError::Data(_)) if run.adam.steps > 0 => {
                run.save(&checkpoint, false)?;
                return Err(error);
            }
            outputs => outputs?,
        };
        let progress = run.step(outputs)?;
        report(&progress);
        let step = run.adam.steps;
        let due = |every| is_due(every, step, steps);
        let stopped = stop.load(Ordering::Relaxed);
        if due(config.log_every) {
            run.log_step(&progress)?;
        }
        if due(config.checkpoint_every) || stopped {
            // An evaluation that is due is also made when stopping here, so that the log is that of an uninterrupted run.
            run.save(&checkpoint, due(config.checkpoint_every))?;
        }
        if stopped && step < steps {
            return Ok(Ended::Stopped { step });
        }
    }
    let weights = folder.join("weights.safetensors");
    run.evaluated_network()?
        .save(&weights, config.weights_metadata())?;
    Ok(Ended::Finished)
}
