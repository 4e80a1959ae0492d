//! Recomputed running statistics of a network, such as one with averaged weights.

use std::sync::Arc;

use super::batch_source::drawing;
use super::config::TrainConfig;
use super::error::TrainError;
use super::trained::tensors;
use crate::data::{Images, Loader, Order};
use crate::network::{Mode, QualityNetwork};

/// Sets the running statistics to the mean of those of the first `recompute_statistics` training batches.
///
/// The batches are drawn as in training, because the weights were fitted to statistics of such a mixture; as in evaluation, images
/// are not augmented and there is no dropout. The statistics therefore depend only on weights, data and seed.
pub(super) fn recompute_statistics(
    config: &TrainConfig,
    network: &QualityNetwork,
    images: &Arc<Images>,
) -> Result<(), TrainError> {
    let order = Order::Training {
        balanced: drawing(config, images)?,
        augmentation: None,
        seed: config.seed,
        first_batch: 0,
    };
    let batches = Loader::new(images, &order, config.batch_size, config.workers);
    for (number, batch) in (0..config.recompute_statistics).zip(batches) {
        let images = tensors(batch?, config.side, network.device())?;
        network.features(&images, Mode::Statistics { batches: number })?;
    }
    Ok(())
}
