//! Network and samples of a configuration, and the network's predictions.

use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::Arc;

use candle_core::{Device, Tensor};

use crate::data::{Batch, Images, Loader, Order, Sample, Views, read_samples};
use crate::network::{Mode, Options, PosePrediction, QualityNetwork};

use super::checkpoint;
use super::config::{LastLayer, Source, TrainConfig};
use super::error::TrainError;

/// The middle of the labels, 1 to 3.
const MIDDLE: f32 = 2.0;

/// Makes the initial network of a configuration.
pub(super) fn network(config: &TrainConfig) -> Result<QualityNetwork, TrainError> {
    let options = Options {
        dropout: config.network.dropout,
        stochastic_depth: config.network.stochastic_depth,
    };
    let fusion = (config.views == Views::Pairs).then_some(config.fusion);
    let network = QualityNetwork::new(config.seed, options, fusion, config.targets())?;
    if config.network.last_layer == LastLayer::Middle {
        network.begin_with(MIDDLE)?;
    }
    Ok(network)
}

/// Reads the configuration and the network, on the CPU, from the folder of a finished training run.
///
/// # Errors
/// [`TrainError`] naming the missing or invalid file; [`TrainError::Unfinished`] with the steps made so far.
pub fn trained(folder: &Path) -> Result<(TrainConfig, QualityNetwork), TrainError> {
    let config = TrainConfig::read_run(folder)?;
    let weights = folder.join("weights.safetensors");
    if !weights.exists() {
        return Err(TrainError::Unfinished {
            folder: folder.to_owned(),
            step: steps_made(folder)?,
            steps: config.schedule().steps(),
        });
    }
    let network = network(&config)?;
    network.load(&weights, config.first_convolution)?;
    Ok((config, network))
}

/// Returns the optimiser step at which the checkpoint of a training run was saved; 0 without a checkpoint.
///
/// # Errors
/// [`TrainError`] naming a checkpoint that cannot be read.
pub fn steps_made(folder: &Path) -> Result<u64, TrainError> {
    let path = folder.join("checkpoint.safetensors");
    match path.exists() {
        true => checkpoint::steps(&path),
        false => Ok(0),
    }
}

/// Reads the labelled samples of sources, as in training.
///
/// # Errors
/// [`TrainError`] for data that cannot be used.
pub fn samples(config: &TrainConfig, sources: &[Source]) -> Result<Vec<Sample>, TrainError> {
    let mut samples = Vec::new();
    for source in sources {
        samples.extend(read_samples(&source.dataset, &config.selection(source))?);
    }
    Ok(samples)
}

/// Returns the images of each camera as a tensor [samples, 1, side, side] on a device.
pub(crate) fn tensors(
    batch: Batch,
    side: usize,
    device: &Device,
) -> Result<Vec<Tensor>, TrainError> {
    let shape = (batch.samples.len(), 1, side, side);
    let cameras = batch.images.into_iter();
    let tensors = cameras.map(|images| Tensor::from_vec(images, shape, device));
    Ok(tensors.collect::<Result<_, _>>()?)
}

/// Returns a network's predictions for all samples, in order, from their evaluation images.
///
/// # Errors
/// [`TrainError`] naming the image that cannot be used.
pub fn predict(
    network: &QualityNetwork,
    images: &Arc<Images>,
    batch_size: NonZeroUsize,
    workers: NonZeroUsize,
) -> Result<Vec<PosePrediction>, TrainError> {
    predict_in_order(network, images, &Order::Once, batch_size, workers)
}

/// The same as [`predict`], for the samples of a finite order.
pub(super) fn predict_in_order(
    network: &QualityNetwork,
    images: &Arc<Images>,
    order: &Order,
    batch_size: NonZeroUsize,
    workers: NonZeroUsize,
) -> Result<Vec<PosePrediction>, TrainError> {
    let mut predictions = Vec::new();
    for batch in Loader::new(images, order, batch_size, workers) {
        let images = tensors(batch?, images.side(), network.device())?;
        let outputs = network.forward(&images, Mode::Eval)?;
        predictions.extend(PosePrediction::of(&outputs)?);
    }
    Ok(predictions)
}
