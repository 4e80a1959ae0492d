//! Training batches and the network's outputs for them, computed by all layers or by the last one only.

use std::sync::Arc;

use candle_core::Tensor;

use super::config::{Layers, TrainConfig};
use super::error::TrainError;
use super::trained::tensors;
use crate::data::{Balanced, Images, Loader, Order};
use crate::network::{Mode, QualityNetwork};

/// The endless sequence of training batches.
pub(super) enum BatchSource {
    /// Augmented images, for all layers.
    Images(Loader),
    /// Linear probing: features of the evaluation images. They do not change, because only the last layer is trained, so each
    /// is computed once.
    Features {
        /// [samples, 1280] of each camera.
        features: Vec<Tensor>,
        labels: Vec<f32>,
        corrections_deg: Vec<Option<f32>>,
        balanced: Balanced,
    },
}

/// Outputs [samples, 1 or 2] for a batch, and their targets.
pub(super) struct Outputs {
    pub outputs: Tensor,
    pub labels: Vec<f32>,
    pub corrections_deg: Vec<Option<f32>>,
}

impl BatchSource {
    /// Starts with batch number `first_batch`.
    pub fn new(
        config: &TrainConfig,
        network: &QualityNetwork,
        images: &Arc<Images>,
        first_batch: u64,
    ) -> Result<Self, TrainError> {
        let balanced = drawing(config, images)?;
        if config.layers == Layers::Last {
            let samples = images.samples().iter();
            let labels = samples.clone().map(|s| s.label as f32).collect();
            let corrections_deg = samples.map(|s| s.correction_deg.map(|degrees| degrees as f32));
            return Ok(Self::Features {
                features: features(config, network, images)?,
                labels,
                corrections_deg: corrections_deg.collect(),
                balanced,
            });
        }
        let order = Order::Training {
            balanced,
            augmentation: Some(config.augmentation),
            seed: config.seed,
            first_batch,
        };
        let loader = Loader::new(images, &order, config.batch_size, config.workers);
        Ok(Self::Images(loader))
    }

    /// Computes the network's outputs for batch number `step`, which must be the next one.
    pub fn outputs(
        &mut self,
        config: &TrainConfig,
        network: &QualityNetwork,
        step: u64,
    ) -> Result<Outputs, TrainError> {
        let mode = Mode::Train { step };
        match self {
            Self::Images(loader) => {
                let batch = loader.next().expect("training batches never end")?;
                let (labels, corrections_deg) =
                    (batch.labels.clone(), batch.corrections_deg.clone());
                let images = tensors(batch, config.side, network.device())?;
                Ok(Outputs {
                    outputs: network.forward(&images, mode)?,
                    labels,
                    corrections_deg,
                })
            }
            Self::Features {
                features,
                labels,
                corrections_deg,
                balanced,
            } => {
                let size = config.batch_size.get() as u64;
                let places = step * size..(step + 1) * size;
                let picked: Vec<_> = places
                    .map(|place| balanced.pick(config.seed, place))
                    .collect();
                let rows: Vec<_> = picked.iter().map(|&sample| sample as u32).collect();
                let rows = Tensor::new(rows, network.device())?;
                let batch = features.iter().map(|camera| camera.index_select(&rows, 0));
                let batch = batch.collect::<Result<Vec<_>, _>>()?;
                Ok(Outputs {
                    outputs: network.classify(&batch, mode)?,
                    labels: picked.iter().map(|&sample| labels[sample]).collect(),
                    corrections_deg: picked
                        .iter()
                        .map(|&sample| corrections_deg[sample])
                        .collect(),
                })
            }
        }
    }
}

/// Returns the sampler of the training samples.
pub(super) fn drawing(config: &TrainConfig, images: &Images) -> Result<Balanced, TrainError> {
    let balanced = Balanced::new(images.samples())?;
    Ok(match config.balanced {
        true => balanced,
        false => balanced.unbalanced(),
    })
}

/// Computes the features of each sample's evaluation images, [samples, 1280] for each camera.
fn features(
    config: &TrainConfig,
    network: &QualityNetwork,
    images: &Arc<Images>,
) -> Result<Vec<Tensor>, TrainError> {
    let batches = Loader::new(images, &Order::Once, config.batch_size, config.workers);
    let of_batch = |batch: Result<_, _>| {
        let images = tensors(batch?, config.side, network.device())?;
        network
            .features(&images, Mode::Eval)
            .map_err(TrainError::from)
    };
    let batches: Vec<_> = batches.map(of_batch).collect::<Result<_, TrainError>>()?;
    let camera = |camera: usize| {
        let parts: Vec<_> = batches.iter().map(|batch| &batch[camera]).collect();
        // Detached because the layers before have no gradient.
        Ok(Tensor::cat(&parts, 0)?.detach())
    };
    (0..network.cameras()).map(camera).collect()
}
