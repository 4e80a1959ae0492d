//! What a training is measured by: errors on evaluation and training images.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::config::TrainConfig;
use super::error::TrainError;
use super::trained::predict_in_order;
use crate::data::{Images, Order};
use crate::network::QualityNetwork;

/// The scalar that every evaluation has in the log.
pub(super) const EVALUATION: &str = "evaluation/mae";
/// Most training samples whose error is measured.
const MOST_TRAINING_SAMPLES: usize = 256;

/// Mean absolute and squared error and Spearman's correlation on evaluation images, the mean absolute error on at most 256 training
/// samples, evenly spread and not augmented, and how much larger that on evaluation images is.
///
/// The correlation is NaN where labels or answers are all the same, and where an answer is not finite.
pub(super) fn scalars(
    config: &TrainConfig,
    network: &QualityNetwork,
    evaluation: &Arc<Images>,
    training: &Arc<Images>,
) -> Result<BTreeMap<String, f64>, TrainError> {
    let predictions = |images: &_, order: &_| {
        predict_in_order(network, images, order, config.batch_size, config.workers)
    };
    let all = training.samples().len();
    let count = all.min(MOST_TRAINING_SAMPLES);
    let spread: Vec<usize> = (0..count).map(|n| n * all / count).collect();
    let known = labels(training, spread.iter().copied());
    let learned = predictions(training, &Order::Listed(spread))?;
    let labels = labels(evaluation, 0..evaluation.samples().len());
    let predictions = predictions(evaluation, &Order::Once)?;
    let mae = mean_of(&labels, &predictions, f64::abs);
    let training_mae = mean_of(&known, &learned, f64::abs);
    let r_s = ppa_metrics::spearman(&labels, &predictions).unwrap_or(f64::NAN);
    let scalars = [
        (EVALUATION, mae),
        ("evaluation/mse", mean_of(&labels, &predictions, |e| e * e)),
        ("evaluation/r_s", r_s),
        ("evaluation/gap", mae - training_mae),
        ("training/mae", training_mae),
    ];
    let named = scalars.into_iter().map(|(tag, x)| (tag.to_owned(), x));
    Ok(named.collect())
}

fn labels(images: &Images, samples: impl Iterator<Item = usize>) -> Vec<f64> {
    samples
        .map(|sample| images.samples()[sample].label)
        .collect()
}

fn mean_of(labels: &[f64], predictions: &[f64], score: fn(f64) -> f64) -> f64 {
    let errors = labels.iter().zip(predictions).map(|(x, y)| score(y - x));
    errors.sum::<f64>() / labels.len() as f64
}
