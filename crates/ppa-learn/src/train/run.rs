//! The loop of a training.

use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use candle_core::{Device, Tensor};
use ppa_dataset::write_whole;

use crate::data::{
    Balanced, Batch, Images, Loader, Order, Sample, Views, check_split, read_samples,
};
use crate::network::{Mode, Options, QualityNetwork};

use super::adam::Adam;
use super::checkpoint;
use super::config::{ConfigError, LastLayer, Source, TrainConfig};
use super::data_state::DataState;
use super::error::TrainError;
use super::feed::{Answers, Feed};
use super::finite::{is_finite, trouble};
use super::log::{Log, LogRow};
use super::start_file;
use super::tensorboard::tensorboard_events;

/// The middle of the labels, 1 to 3.
const MIDDLE: f32 = 2.0;

/// The scalar that every evaluation has in the log.
const EVALUATION: &str = "evaluation/mae";

/// How far a training is; told after every step.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// Steps made.
    pub step: u64,
    /// Steps in all.
    pub steps: u64,
    /// Mean squared error of the step's batch.
    pub loss: f32,
    /// Rate of the step.
    pub rate: f64,
}

/// How a training ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// All steps are made.
    Finished,
    /// It was asked to stop; the checkpoint holds the steps made so far.
    Stopped {
        /// Steps made.
        step: u64,
    },
}

/// Trains as a configuration says, in a folder; goes on from the folder's checkpoint, if there is one, to the same bytes
/// as a training that was never stopped.
///
/// # Errors
/// [`TrainError`]. Where an image is at fault, the checkpoint holds all steps made before; else it is the last whole one.
pub fn train(
    config: &TrainConfig,
    folder: &Path,
    stop: &AtomicBool,
    mut report: impl FnMut(&Progress),
) -> Result<Ended, TrainError> {
    config.check()?;
    let device = config.device.open()?;
    let training = samples(config, &config.training)?;
    let evaluation = samples(config, &config.evaluation)?;
    check_split(&training, &evaluation)?;
    let echoed = toml::to_string(config).map_err(|e| ConfigError::Write(e.to_string()))?;
    Balanced::new(&training)?; // Labels outside the scale are found before training.
    if !evaluation.is_empty() {
        Balanced::new(&evaluation)?;
    }

    let network = network(config)?.to_device(&device)?;
    let checkpoint = folder.join("checkpoint.safetensors");
    let data = DataState::of(&training);
    let adam = if checkpoint.exists() {
        checkpoint::load(&checkpoint, &network, config, &data)?
    } else {
        let weights = folder.join("weights.safetensors");
        if weights.exists() {
            return Err(TrainError::WeightsAlone(weights));
        }
        if let Some(start) = &config.start {
            let loaded = network.load(start, config.first_convolution)?;
            start_file::write(folder, &loaded)?;
        }
        Adam::new(network.variables().iter().map(|v| v.elem_count()))
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
        seconds_before: log.rows.last().map_or(0.0, |row| row.seconds),
        log,
        started: Instant::now(),
        evaluation: match evaluation.is_empty() {
            true => None,
            false => Some(Arc::new(Images::new(evaluation, config.side, keep_bytes)?)),
        },
    };
    let images = Arc::new(Images::new(training, config.side, keep_bytes)?);
    let mut feed = Feed::new(config, &run.network, &images, run.adam.steps)?;
    let steps = config.schedule().steps();
    run.make_up_evaluation()?;
    while run.adam.steps < steps {
        let answers = match feed.answers(config, &run.network, run.adam.steps) {
            // An image that cannot be used costs no step that was made.
            Err(error @ TrainError::Data(_)) if run.adam.steps > 0 => {
                run.save(&checkpoint, false)?;
                return Err(error);
            }
            answers => answers?,
        };
        let progress = run.step(answers)?;
        report(&progress);
        let step = run.adam.steps;
        let due = |every| is_due(every, step, steps);
        let stopped = stop.load(Ordering::Relaxed);
        if due(config.log_every) {
            run.log_step(&progress)?;
        }
        if due(config.checkpoint_every) || stopped {
            // An evaluation that is due is made by a training that stops here as well: the log is that of one that does not stop.
            run.save(&checkpoint, due(config.checkpoint_every))?;
        }
        if stopped && step < steps {
            return Ok(Ended::Stopped { step });
        }
    }
    run.network.save(&folder.join("weights.safetensors"))?;
    Ok(Ended::Finished)
}

/// Whether what is done `every` so many steps is done after `step`; all is after the last one.
fn is_due(every: NonZeroUsize, step: u64, steps: u64) -> bool {
    step.is_multiple_of(every.get() as u64) || step == steps
}

fn network(config: &TrainConfig) -> Result<QualityNetwork, TrainError> {
    let options = Options {
        dropout: config.network.dropout,
        stochastic_depth: config.network.stochastic_depth,
    };
    let fusion = (config.views == Views::Pairs).then_some(config.fusion);
    let network = QualityNetwork::new(config.seed, options, fusion)?;
    if config.network.last_layer == LastLayer::Middle {
        network.begin_with(MIDDLE)?;
    }
    Ok(network)
}

/// The network of a finished training on the CPU: its configuration and its weights, from its folder.
///
/// # Errors
/// [`TrainError`] naming the file that is missing or is none of a training.
pub fn trained(folder: &Path) -> Result<(TrainConfig, QualityNetwork), TrainError> {
    let config = TrainConfig::read(&folder.join("config.toml"))?;
    let network = network(&config)?;
    let weights = folder.join("weights.safetensors");
    network.load(&weights, config.first_convolution)?;
    Ok((config, network))
}

/// The labelled samples of some sources, as a training reads them.
///
/// # Errors
/// [`TrainError`] for data that cannot be used.
pub fn samples(config: &TrainConfig, sources: &[Source]) -> Result<Vec<Sample>, TrainError> {
    let mut samples = Vec::new();
    for source in sources {
        let persons = source.patients.as_deref();
        let frames = config.frames_per_pose;
        let shapes = source.shapes.as_deref();
        let dataset = &source.dataset;
        samples.extend(read_samples(
            dataset,
            persons,
            shapes,
            config.views,
            frames,
        )?);
    }
    Ok(samples)
}

/// Images of each camera as a tensor [samples, 1, side, side] on a device.
pub(super) fn tensors(
    batch: Batch,
    side: usize,
    device: &Device,
) -> Result<Vec<Tensor>, TrainError> {
    let shape = (batch.samples.len(), 1, side, side);
    let cameras = batch.images.into_iter();
    let tensors = cameras.map(|images| Tensor::from_vec(images, shape, device));
    Ok(tensors.collect::<Result<_, _>>()?)
}

struct Run<'a> {
    config: &'a TrainConfig,
    folder: &'a Path,
    data: DataState,
    network: QualityNetwork,
    adam: Adam,
    log: Log,
    started: Instant,
    /// Of earlier runs of the same training.
    seconds_before: f64,
    evaluation: Option<Arc<Images>>,
}

impl Run<'_> {
    fn step(&mut self, answers: Answers) -> Result<Progress, TrainError> {
        let step = self.adam.steps;
        let labels = Tensor::new(answers.labels, self.network.device())?.unsqueeze(1)?;
        let loss = (answers.outputs - labels)?.sqr()?.mean_all()?;
        let mut gradients = loss.backward()?;
        for variable in self.network.variables() {
            // Adam's moments are on the CPU wherever the network is.
            if let Some(gradient) = gradients.remove(variable) {
                gradients.insert(variable, gradient.to_device(&Device::Cpu)?);
            }
        }
        let loss = loss.to_scalar::<f32>()?;
        let mut finite = loss.is_finite();
        for variable in self.network.variables() {
            if let Some(gradient) = gradients.get(variable) {
                finite &= is_finite(gradient)?;
            }
        }
        if !finite {
            return Err(TrainError::NotFinite {
                step,
                loss,
                trouble: trouble(&self.network, &gradients)?,
            });
        }
        let schedule = self.config.schedule();
        let rate = schedule.rate(step);
        self.adam
            .step(&self.network.variables(), &gradients, rate)?;
        Ok(Progress {
            step: self.adam.steps,
            steps: schedule.steps(),
            loss,
            rate,
        })
    }

    fn seconds(&self) -> f64 {
        self.seconds_before + self.started.elapsed().as_secs_f64()
    }

    fn log_step(&mut self, progress: &Progress) -> Result<(), TrainError> {
        let scalars = [
            ("training/loss".to_owned(), f64::from(progress.loss)),
            ("training/rate".to_owned(), progress.rate),
        ];
        self.log.push(LogRow {
            step: progress.step,
            seconds: self.seconds(),
            scalars: scalars.into(),
        })
    }

    /// Evaluates after the step of the checkpoint, if that was due and failed when the step was made.
    fn make_up_evaluation(&mut self) -> Result<(), TrainError> {
        let step = self.adam.steps;
        let due = is_due(
            self.config.checkpoint_every,
            step,
            self.config.schedule().steps(),
        );
        let mut rows = self.log.rows.iter().rev();
        let done = rows.any(|row| row.step == step && row.scalars.contains_key(EVALUATION));
        if step == 0 || !due || done || self.evaluation.is_none() {
            return Ok(());
        }
        self.evaluate()?;
        self.write_events()
    }

    /// Adds a row of the evaluation to the log, if there is anybody to evaluate on.
    fn evaluate(&mut self) -> Result<(), TrainError> {
        if let Some(images) = &self.evaluation {
            let predictions = predict(
                &self.network,
                images,
                self.config.batch_size,
                self.config.workers,
            )?;
            let errors = predictions.iter().zip(images.samples());
            let errors: Vec<f64> = errors.map(|(y, sample)| y - sample.label).collect();
            let mean = |score: fn(&f64) -> f64| {
                errors.iter().map(score).sum::<f64>() / errors.len() as f64
            };
            let scalars = [
                (EVALUATION.to_owned(), mean(|e| e.abs())),
                ("evaluation/mse".to_owned(), mean(|e| e * e)),
            ];
            self.log.push(LogRow {
                step: self.adam.steps,
                seconds: self.seconds(),
                scalars: scalars.into(),
            })?;
        }
        Ok(())
    }

    /// Writes the checkpoint and, from the log, the events; evaluates before, if asked.
    fn save(&mut self, checkpoint: &Path, evaluate: bool) -> Result<(), TrainError> {
        let evaluated = match evaluate {
            true => self.evaluate(),
            false => Ok(()),
        };
        // An evaluation that fails costs no steps.
        let Self {
            network,
            adam,
            config,
            data,
            ..
        } = &*self;
        checkpoint::save(checkpoint, network, adam, config, data)?;
        evaluated?;
        self.write_events()
    }

    /// Writes TensorBoard's events from the log.
    fn write_events(&self) -> Result<(), TrainError> {
        let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        let started = now.map_or(0.0, |now| now.as_secs_f64()) - self.seconds();
        let events = tensorboard_events(&self.log.rows, started);
        Ok(write_whole(
            &self.folder.join("events.out.tfevents.ppa"),
            &events,
        )?)
    }
}

/// What a network says of each sample, in order, from its evaluation images.
///
/// # Errors
/// [`TrainError`] naming the image that cannot be used.
pub fn predict(
    network: &QualityNetwork,
    images: &Arc<Images>,
    batch_size: NonZeroUsize,
    workers: NonZeroUsize,
) -> Result<Vec<f64>, TrainError> {
    let mut predictions = Vec::new();
    for batch in Loader::new(images, &Order::Once, batch_size, workers) {
        let images = tensors(batch?, images.side(), network.device())?;
        let outputs = network.forward(&images, Mode::Eval)?;
        let outputs: Vec<f32> = outputs.flatten_all()?.to_vec1()?;
        predictions.extend(outputs.into_iter().map(f64::from));
    }
    Ok(predictions)
}
