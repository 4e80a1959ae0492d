//! Calibration on predictions for persons who were not in the training data.

use std::collections::BTreeSet;
use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::Arc;

use candle_core::Tensor;
use ppa_dataset::layout::LimbId;
use serde::Serialize;

use super::confidence::{Confidence, fingerprints};
use super::error::FramesError;
use super::networks::{Moment, Networks, Trained};
use crate::DeviceName;
use crate::confidence::{Descriptors, Intervals, OutOfDistributionDetector, coverage_of_left_out};
use crate::data::{Images, Loader, Order, Sample, Views, check_split};
use crate::train::{Source, TrainConfig, TrainError, samples, tensors};

/// Share of the calibration images that are within a descriptor's limit.
const IN_DISTRIBUTION: f64 = 0.99;
/// Maximum number of a network's training images that other images are compared with.
const MAX_REFERENCES: usize = 512;

/// Result of a calibration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Calibration {
    /// Number of calibration persons.
    pub persons: usize,
    /// Number of image pairs.
    pub pairs: usize,
    /// The intervals.
    pub intervals: Intervals,
    /// Share of labels in the intervals calibrated on the other persons, if there are enough.
    pub coverage_of_left_out_persons: Option<f64>,
}

impl Confidence {
    /// Calibrates the networks in the folders of finished training runs, given as for [`super::PairPredictor::new`], with images of both
    /// cameras of persons who were not in the training data; `coverage` is the probability of the intervals.
    ///
    /// # Errors
    /// [`FramesError`] naming the folder or image that cannot be used, or the number of images that is too small.
    pub fn calibrate(
        left: &Path,
        right: Option<&Path>,
        sources: &[Source],
        coverage: f64,
        device: DeviceName,
    ) -> Result<(Self, Calibration), FramesError> {
        let networks = Networks::open(left, right, device)?;
        let inputs = networks.of_inputs();
        let pairs = TrainConfig {
            views: Views::Pairs,
            ..inputs[0].config.clone()
        };
        let tested = samples(&pairs, sources)?;
        for trained in inputs {
            let training = samples(&trained.config, &trained.config.training)?;
            check_split(&training, &tested).map_err(TrainError::from)?;
        }
        let moments = moments(&networks, &tested)?;
        let answers: Vec<_> = tested.iter().zip(&moments).map(answer).collect();
        let pairs: Vec<_> = answers.iter().map(|&(_, x, y)| (x, y)).collect();
        let intervals = Intervals::new(&pairs, coverage)?;
        let persons: BTreeSet<_> = answers.iter().map(|answer| answer.0).collect();
        let detector = |input: usize| {
            let references = references(inputs[input], input)?;
            let own: Vec<_> = moments.iter().map(|m| m.images[input].clone()).collect();
            OutOfDistributionDetector::new(&references, &own, IN_DISTRIBUTION).ok_or(
                FramesError::FewImages {
                    training: references.len(),
                    calibration: own.len(),
                },
            )
        };
        let calibration = Calibration {
            persons: persons.len(),
            pairs: moments.len(),
            coverage_of_left_out_persons: coverage_of_left_out(&answers, coverage),
            intervals: intervals.clone(),
        };
        let confidence = Self {
            detectors: [detector(0)?, detector(1)?],
            networks: fingerprints(&networks)?,
            intervals,
        };
        Ok((confidence, calibration))
    }
}

/// Returns person, label and prediction.
fn answer<'a>((sample, moment): (&'a Sample, &Moment)) -> ((&'a Path, u32), f64, f64) {
    let LimbId { patient, .. } = sample.limb;
    let person = (&*sample.dataset, patient);
    (person, sample.label, moment.prediction.quality)
}

/// Evaluates the networks on samples of both cameras.
fn moments(networks: &Networks, samples: &[Sample]) -> Result<Vec<Moment>, FramesError> {
    let [left, right] = networks.of_inputs();
    let batches = [left, right].map(|trained| batches(trained, samples.to_vec()));
    let [left, right] = batches;
    let mut moments = Vec::new();
    for (left, right) in left?.zip(right?) {
        // Each network gets the images of its own camera.
        moments.extend(networks.moments(&[left?.swap_remove(0), right?.swap_remove(1)])?);
    }
    Ok(moments)
}

/// Returns the descriptors of at most [`MAX_REFERENCES`] evenly spaced training images of an input's network.
fn references(trained: &Trained, input: usize) -> Result<Vec<Descriptors>, FramesError> {
    let all = samples(&trained.config, &trained.config.training)?;
    let count = all.len().min(MAX_REFERENCES);
    let spread = (0..count).map(|n| all[n * all.len() / count].clone());
    let mut references = Vec::new();
    for images in batches(trained, spread.collect())? {
        let (_, mut of_cameras) = trained.outputs(&images?)?;
        // A network of one camera has only one set of images.
        references.extend(of_cameras.swap_remove(input.min(of_cameras.len() - 1)));
    }
    Ok(references)
}

/// Loads the network inputs of samples, by camera.
fn batches(
    trained: &Trained,
    samples: Vec<Sample>,
) -> Result<impl Iterator<Item = Result<Vec<Tensor>, TrainError>>, TrainError> {
    let side = trained.config.side;
    let images = Arc::new(Images::new(samples, side, 0)?);
    // The same size for both networks, whose batches are paired.
    let batch_size = NonZeroUsize::MIN.saturating_add(31);
    let loader = Loader::new(&images, &Order::Once, batch_size, trained.config.workers);
    let device = trained.network.device().clone();
    Ok(loader.map(move |batch| tensors(batch?, side, &device)))
}
