//! Errors of predictions without a network on the same images, and whether a network is better.

use std::fmt;

use serde::Serialize;

use super::error::EvaluateError;
use super::kernel_ridge::KernelRidge;
use super::means::means;
use super::row::Row;
use super::scores::Scores;
use super::verdict::{
    BaselineKind, Compared, Verdict, mean_by, p_network_better, sentence, verdict,
};
use crate::data::{Images, Sample, evaluation_input};

/// Columns and rows of the images for kernel ridge regression.
const SMALL_SIDE: usize = 16;
/// Maximum number of training images of kernel ridge regression, evenly spaced among all.
const MOST_IMAGES: usize = 1000;

/// Scores of a baseline, and its comparison with the network.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Baseline {
    /// Kind of baseline.
    pub kind: BaselineKind,
    /// Scores over the images.
    #[serde(flatten)]
    pub scores: Scores,
    /// p-value of an exact one-sided sign-flip test of persons' mean absolute errors: small if the network's are lower.
    pub p_network_better: f64,
}

/// Baselines on a test set, next to the network's error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Baselines {
    /// The baselines.
    pub baselines: Vec<Baseline>,
    /// Mean absolute error of the network.
    pub network_mae: f64,
    /// Number of persons whose errors are compared.
    pub persons: usize,
    /// Mean absolute error of labels that are normally distributed with their `std` about the true ones: no prediction can be expected
    /// to have a lower one. `None` if all standard deviations are 0.
    pub label_noise_mae: Option<f64>,
    /// Mean absolute error in degrees of corrections from the true angle to the mean best angle of the training limbs. `None` if
    /// either is unknown.
    pub correction_mae_deg: Option<f64>,
    /// Whether the network is better.
    pub verdict: Verdict,
}

impl Baselines {
    /// Compares baselines fitted to the training samples with the network's predictions in `rows`, one for each tested sample.
    ///
    /// # Errors
    /// [`EvaluateError`] naming the image that cannot be used; [`DataError::Empty`](crate::data::DataError::Empty) if there are no samples.
    ///
    /// # Panics
    /// If there is not one row for each tested sample.
    pub fn of(training: &[Sample], tested: &[Sample], rows: &[Row]) -> Result<Self, EvaluateError> {
        assert_eq!(tested.len(), rows.len(), "one row for each tested sample");
        let predicted = baseline_predictions(training, tested)?;
        let network: Vec<f64> = rows.iter().map(|row| row.prediction).collect();
        let of_network = errors_of_persons(rows, &network);
        let scores = |predictions: &[f64]| {
            let pairs = rows.iter().zip(predictions);
            Scores::of(&pairs.map(|(row, &p)| (row.label, p)).collect::<Vec<_>>())
        };
        let network_mae = scores(&network).mae.unwrap_or(f64::NAN);
        let baseline = |(kind, predictions): &(BaselineKind, Vec<f64>)| {
            let errors = errors_of_persons(rows, predictions);
            Baseline {
                kind: *kind,
                scores: scores(predictions),
                p_network_better: p_network_better(&errors, &of_network),
            }
        };
        let baselines: Vec<Baseline> = predicted.iter().map(baseline).collect();
        let verdict = verdict(network_mae, &compared(&baselines));
        Ok(Self {
            baselines,
            network_mae,
            persons: of_network.len(),
            label_noise_mae: label_noise_mae(tested.iter().map(|sample| sample.label_std)),
            correction_mae_deg: correction_mae_deg(training, tested),
            verdict,
        })
    }
}

impl fmt::Display for Baselines {
    /// Writes the verdict in one or two sentences.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let compared = compared(&self.baselines);
        f.write_str(&sentence(self.network_mae, &compared, self.persons))
    }
}

/// Errors of the baselines; an undefined error is NaN and never lower than the network's.
fn compared(baselines: &[Baseline]) -> Vec<Compared> {
    let one = |baseline: &Baseline| Compared {
        kind: baseline.kind,
        mae: baseline.scores.mae.unwrap_or(f64::NAN),
        p_network_better: baseline.p_network_better,
    };
    baselines.iter().map(one).collect()
}

/// Returns the predictions of each baseline for the tested samples; the baseline by angle only if all angles are known.
///
/// # Errors
/// [`EvaluateError`] naming the image that cannot be used.
pub(crate) fn baseline_predictions(
    training: &[Sample],
    tested: &[Sample],
) -> Result<Vec<(BaselineKind, Vec<f64>)>, EvaluateError> {
    let constant = vec![mean_label(training); tested.len()];
    let mut predicted = vec![
        (BaselineKind::Constant, constant),
        (BaselineKind::KernelRidge, kernel_ridge(training, tested)?),
    ];
    if let Some(by_angle) = by_angle(training, tested) {
        predicted.insert(1, (BaselineKind::Angle, by_angle));
    }
    Ok(predicted)
}

/// Returns the best angle of a sample's limb.
fn best_angle_deg(sample: &Sample) -> Option<f64> {
    Some(sample.angle_deg? + sample.correction_deg?)
}

/// Returns the mean distance of the tested samples' best angles from the mean best angle of the training samples.
fn correction_mae_deg(training: &[Sample], tested: &[Sample]) -> Option<f64> {
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
    let known = mean(training.iter().filter_map(best_angle_deg).collect());
    let errors = tested.iter().filter_map(best_angle_deg);
    let mae = mean(errors.map(|best| (best - known).abs()).collect());
    mae.is_finite().then_some(mae)
}

fn mean_label(samples: &[Sample]) -> f64 {
    samples.iter().map(|sample| sample.label).sum::<f64>() / samples.len() as f64
}

/// Returns the mean absolute error of each person.
fn errors_of_persons(rows: &[Row], predictions: &[f64]) -> Vec<f64> {
    let persons = rows.iter().map(|row| (row.dataset, row.patient));
    let errors = rows.iter().zip(predictions);
    let errors = errors.map(|(row, prediction)| (row.label - prediction).abs());
    mean_by(persons.zip(errors)).into_values().collect()
}

/// Returns the mean label of the training samples at each tested angle; `None` unless all angles are known.
fn by_angle(training: &[Sample], tested: &[Sample]) -> Option<Vec<f64>> {
    let labels: Vec<(f64, f64)> = training
        .iter()
        .map(|sample| Some((sample.angle_deg?, sample.label)))
        .collect::<Option<_>>()?;
    let means = means(labels.into_iter());
    let at = |angle: f64| {
        let above = means.partition_point(|(known, ..)| *known < angle);
        let (&first, &last) = (means.first()?, means.last()?);
        let Some(&(high, label, _)) = means.get(above) else {
            return Some(last.1);
        };
        if above == 0 {
            return Some(first.1);
        }
        let (low, before, _) = means[above - 1];
        Some(before + (label - before) * (angle - low) / (high - low))
    };
    tested.iter().map(|sample| at(sample.angle_deg?)).collect()
}

fn kernel_ridge(training: &[Sample], tested: &[Sample]) -> Result<Vec<f64>, EvaluateError> {
    let some = training
        .iter()
        .step_by(training.len().div_ceil(MOST_IMAGES).max(1));
    let some: Vec<Sample> = some.cloned().collect();
    let mut names: Vec<_> = some.iter().map(|s| (&s.dataset, s.limb.patient)).collect();
    let persons = names.clone();
    names.sort_unstable();
    names.dedup();
    let number = |person| {
        names
            .binary_search(person)
            .expect("every person has a number")
    };
    let groups: Vec<usize> = persons.iter().map(number).collect();
    let labels: Vec<f64> = some.iter().map(|sample| sample.label).collect();
    let fit = KernelRidge::fit(small_images(&some)?, &labels, &groups);
    let tested = small_images(tested)?;
    Ok(tested.iter().map(|image| fit.predict(image)).collect())
}

/// Returns the concatenated images of each sample as inputs of side [`SMALL_SIDE`].
fn small_images(samples: &[Sample]) -> Result<Vec<Vec<f32>>, EvaluateError> {
    let images = Images::new(samples.to_vec(), SMALL_SIDE, 0)?;
    let small = |sample: usize| {
        let prepared = images.get(sample)?;
        let inputs = prepared.iter();
        let inputs = inputs.flat_map(|image| evaluation_input(image, SMALL_SIDE).into_values());
        Ok(inputs.collect())
    };
    (0..samples.len()).map(small).collect()
}

/// Returns √(2/π) times the mean standard deviation, the mean absolute value of a normal deviate; `None` if it is 0.
pub(crate) fn label_noise_mae(label_stds: impl ExactSizeIterator<Item = f64>) -> Option<f64> {
    let n = label_stds.len() as f64;
    let mean = label_stds.sum::<f64>() / n;
    (mean > 0.0).then(|| std::f64::consts::FRAC_2_PI.sqrt() * mean)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::sample_without_images;

    fn at(angle_deg: f64, label: f64) -> Sample {
        Sample {
            angle_deg: Some(angle_deg),
            ..sample_without_images(label, 0)
        }
    }

    #[test]
    fn labels_by_angle_are_means_and_linear_between() {
        let training = [at(0.0, 3.0), at(20.0, 1.0), at(20.0, 2.0), at(30.0, 2.5)];
        let tested = [-5.0, 0.0, 10.0, 20.0, 28.0, 60.0].map(|angle| at(angle, 2.0));
        let found = by_angle(&training, &tested).unwrap();
        let expected = [3.0, 3.0, 2.25, 1.5, 2.3, 2.5];
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found}, {expected}");
        }
        assert_eq!(by_angle(&training, &[sample_without_images(2.0, 0)]), None);
    }

    #[test]
    fn label_noise_is_that_of_normal_deviates() {
        assert_eq!(label_noise_mae([0.0].into_iter()), None);
        let found = label_noise_mae([0.2, 0.4].into_iter()).unwrap();
        assert!((found - 0.3 * 0.797_884_560_8).abs() < 1e-9, "{found}");
    }
}
