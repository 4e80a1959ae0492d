//! The steps of a training, with measurements and checkpoints between them.

use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use candle_core::{Device, Tensor};
use ppa_dataset::write_whole;

use crate::data::Images;
use crate::network::QualityNetwork;

use super::adam::Adam;
use super::batch_source::Outputs;
use super::checkpoint;
use super::config::TrainConfig;
use super::data_state::DataState;
use super::error::TrainError;
use super::finite::{is_finite, trouble};
use super::log::{Log, LogRow};
use super::run::Progress;
use super::tensorboard::tensorboard_events;
use super::trained::predict;

/// The scalar that every evaluation has in the log.
const EVALUATION: &str = "evaluation/mae";

/// Whether what is done `every` so many steps is done after `step`; all is after the last one.
pub(super) fn is_due(every: NonZeroUsize, step: u64, steps: u64) -> bool {
    step.is_multiple_of(every.get() as u64) || step == steps
}

/// A training under way.
pub(super) struct Run<'a> {
    pub config: &'a TrainConfig,
    pub folder: &'a Path,
    pub data: DataState,
    pub network: QualityNetwork,
    pub adam: Adam,
    pub log: Log,
    pub started: Instant,
    /// Of earlier runs of the same training.
    pub seconds_before: f64,
    pub evaluation: Option<Arc<Images>>,
}

impl Run<'_> {
    /// Makes a step from what the network said of a batch.
    pub fn step(&mut self, batch: Outputs) -> Result<Progress, TrainError> {
        let step = self.adam.steps;
        let labels = Tensor::new(batch.labels, self.network.device())?.unsqueeze(1)?;
        let loss = (batch.outputs - labels)?.sqr()?.mean_all()?;
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
        let learning_rate = schedule.learning_rate(step);
        self.adam
            .step(&self.network.variables(), &gradients, learning_rate)?;
        Ok(Progress {
            step: self.adam.steps,
            steps: schedule.steps(),
            loss,
            learning_rate,
        })
    }

    fn seconds(&self) -> f64 {
        self.seconds_before + self.started.elapsed().as_secs_f64()
    }

    /// Adds a row of a step to the log.
    pub fn log_step(&mut self, progress: &Progress) -> Result<(), TrainError> {
        let scalars = [
            ("training/loss".to_owned(), f64::from(progress.loss)),
            ("training/rate".to_owned(), progress.learning_rate),
        ];
        self.log.push(LogRow {
            step: progress.step,
            seconds: self.seconds(),
            scalars: scalars.into(),
        })
    }

    /// Evaluates after the step of the checkpoint, if that was due and failed when the step was made.
    pub fn make_up_evaluation(&mut self) -> Result<(), TrainError> {
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
    pub fn save(&mut self, checkpoint: &Path, evaluate: bool) -> Result<(), TrainError> {
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
