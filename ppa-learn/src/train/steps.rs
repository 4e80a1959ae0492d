//! The steps of a training run, with measurements and checkpoints between them.

use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use ppa_dataset::write_whole;

use crate::data::Images;
use crate::network::QualityNetwork;

use super::adam::Adam;
use super::average::Average;
use super::batch_source::Outputs;
use super::checkpoint;
use super::config::{Layers, TrainConfig};
use super::data_state::DataState;
use super::error::TrainError;
use super::finite::{first_non_finite, is_finite};
use super::log::{Log, LogRow};
use super::loss::loss;
use super::measure::{EVALUATION, scalars};
use super::run::Progress;
use super::statistics::recompute_statistics;
use super::tensorboard::tensorboard_events;

/// Returns whether an action that is due every `every` steps is due after `step`; after the last step it always is.
pub(super) fn is_due(every: NonZeroUsize, step: u64, steps: u64) -> bool {
    step.is_multiple_of(every.get() as u64) || step == steps
}

/// State of a training run.
pub(super) struct Run<'a> {
    pub config: &'a TrainConfig,
    pub folder: &'a Path,
    pub data: DataState,
    pub network: QualityNetwork,
    pub adam: Adam,
    pub average: Option<Average>,
    pub log: Log,
    pub started: Instant,
    /// Seconds before interruptions of the same training run.
    pub seconds_before: f64,
    pub training: Arc<Images>,
    pub evaluation: Option<Arc<Images>>,
}

impl Run<'_> {
    /// Makes a step from the network's outputs for a batch.
    pub fn step(&mut self, batch: Outputs) -> Result<Progress, TrainError> {
        let step = self.adam.steps;
        let loss = loss(&batch, self.config.correction_weight)?;
        let gradients = loss.backward()?;
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
                place: first_non_finite(&self.network, &gradients)?,
            });
        }
        let schedule = self.config.schedule();
        let learning_rate = schedule.learning_rate(step);
        self.adam
            .step(&self.network.variables(), &gradients, learning_rate)?;
        if let Some(average) = &mut self.average {
            let decay = self.config.weight_average;
            average.add(&self.network.variables(), decay, self.adam.steps)?;
        }
        Ok(Progress {
            step: self.adam.steps,
            steps: schedule.steps(),
            loss,
            learning_rate,
        })
    }

    /// Returns the network that is evaluated and saved: with averaged weights and recomputed statistics, if configured.
    pub fn evaluated_network(&self) -> Result<QualityNetwork, TrainError> {
        let config = self.config;
        // The features of linear probing are computed with the statistics of its start.
        let recomputed = config.recompute_statistics > 0 && config.layers == Layers::All;
        if self.average.is_none() && !recomputed {
            return Ok(self.network.clone());
        }
        let network = self.network.to_device(self.network.device())?;
        if let Some(average) = &self.average {
            average.assign(&network.variables())?;
        }
        if recomputed {
            recompute_statistics(config, &network, &self.training)?;
        }
        Ok(network)
    }

    fn seconds(&self) -> f64 {
        self.seconds_before + self.started.elapsed().as_secs_f64()
    }

    /// Adds a row for a step to the log.
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

    /// Repeats an evaluation that was due at the checkpoint's step but failed.
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

    /// Adds a row for an evaluation to the log, if there are evaluation images.
    fn evaluate(&mut self) -> Result<(), TrainError> {
        if let Some(evaluation) = &self.evaluation {
            let network = self.evaluated_network()?;
            let scalars = scalars(self.config, &network, evaluation, &self.training)?;
            self.log.push(LogRow {
                step: self.adam.steps,
                seconds: self.seconds(),
                scalars,
            })?;
        }
        Ok(())
    }

    /// Writes the checkpoint and, from the log, the events; evaluates before that if `evaluate`.
    pub fn save(&mut self, checkpoint: &Path, evaluate: bool) -> Result<(), TrainError> {
        let evaluated = match evaluate {
            true => self.evaluate(),
            false => Ok(()),
        };
        // An evaluation that fails does not lose steps.
        let Self {
            network,
            adam,
            average,
            config,
            data,
            ..
        } = &*self;
        checkpoint::save(checkpoint, network, adam, average.as_ref(), config, data)?;
        evaluated?;
        self.write_events()
    }

    /// Writes TensorBoard events from the log.
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
