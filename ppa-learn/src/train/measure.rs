//! Measurements of a training run: errors on evaluation and training images.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::config::TrainConfig;
use super::error::TrainError;
use super::trained::predict_in_order;
use crate::data::{Images, Order, Sample};
use crate::network::{PosePrediction, QualityNetwork};

/// A scalar that every evaluation writes to the log.
pub(super) const EVALUATION: &str = "evaluation/mae";
/// Maximum number of training samples whose error is measured.
const MOST_TRAINING_SAMPLES: usize = 256;

/// Measures mean absolute and squared error and Spearman's correlation on evaluation images, the mean absolute error on at most 256
/// evenly spaced training samples without augmentation, and how much larger that on evaluation images is; also the mean absolute error
/// of corrections if they are predicted and known.
///
/// The correlation is NaN if all labels or all predictions are the same, or if a prediction is not finite.
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
    let quality = |predictions: &[PosePrediction]| predictions.iter().map(|p| p.quality).collect();
    let (learned, qualities): (Vec<f64>, Vec<f64>) = (quality(&learned), quality(&predictions));
    let mae = mean_of(&labels, &qualities, f64::abs);
    let training_mae = mean_of(&known, &learned, f64::abs);
    let r_s = ppa_metrics::spearman(&labels, &qualities).unwrap_or(f64::NAN);
    let scalars = [
        (EVALUATION, mae),
        ("evaluation/mse", mean_of(&labels, &qualities, |e| e * e)),
        ("evaluation/r_s", r_s),
        ("evaluation/gap", mae - training_mae),
        ("training/mae", training_mae),
    ];
    let corrections = correction_mae_deg(evaluation.samples(), &predictions);
    let correction = corrections.map(|mae| ("evaluation/correction_mae_deg", mae));
    let named = scalars.into_iter().chain(correction);
    Ok(named.map(|(tag, x)| (tag.to_owned(), x)).collect())
}

/// Returns `None` if no correction is both predicted and known.
fn correction_mae_deg(samples: &[Sample], predictions: &[PosePrediction]) -> Option<f64> {
    let both = samples.iter().zip(predictions);
    let errors = both.filter_map(|(s, p)| Some((s.correction_deg? - p.correction_deg?).abs()));
    let errors: Vec<f64> = errors.collect();
    (!errors.is_empty()).then(|| errors.iter().sum::<f64>() / errors.len() as f64)
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
