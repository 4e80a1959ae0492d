//! Training of a network, from a configuration to weights. It can be resumed, and gives the same bytes however it was interrupted.
//!
//! [`train`] follows a [`TrainConfig`] and fills a run folder: `config.toml` (the resolved configuration), `log.jsonl` and TensorBoard
//! events (the same scalars), `start.json` (what was not taken unchanged from the `start` file), `checkpoint.safetensors` (weights by
//! torchvision's names, running statistics, Adam's moments, averaged weights, step), and at the end `weights.safetensors`. Data
//! position and random numbers follow from seed and step.

mod adam;
mod average;
mod batch_source;
mod cautions;
mod checkpoint;
mod config;
mod config_error;
mod config_file;
mod crc32c;
mod data_state;
mod error;
mod finite;
mod limits;
mod log;
mod loss;
mod measure;
mod presets;
mod run;
mod schedule;
mod start_file;
mod statistics;
mod steps;
mod tensorboard;
mod trained;

pub use adam::Adam;
pub use cautions::cautions;
pub use config::{LastLayer, Layers, NetworkConfig, Source, TrainConfig};
pub use config_error::ConfigError;
pub(crate) use config_file::merge;
pub use error::TrainError;
pub use finite::NonFinite;
pub use log::{LogRow, read_log};
pub use run::{Ended, Progress, train};
pub use schedule::{RateSchedule, Schedule, StepCounting};
pub use start_file::read_start;
pub use tensorboard::tensorboard_events;
pub(crate) use trained::tensors;
pub use trained::{predict, samples, steps_made, trained};
