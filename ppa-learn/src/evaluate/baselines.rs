//! What predictions without a network achieve on the same images, and whether a network is better.

use std::collections::BTreeMap;
use std::fmt;

use ppa_metrics::{MAX_PAIRS, sign_flip_permutation};
use serde::Serialize;

use super::error::EvaluateError;
use super::kernel_ridge::KernelRidge;
use super::means::means;
use super::row::Row;
use super::scores::Scores;
use crate::data::{Images, Sample, evaluation_input};

/// Columns and rows of the images that kernel ridge regression sees.
const SMALL_SIDE: usize = 16;
/// Most training images of kernel ridge regression, evenly spaced among all.
const MOST_IMAGES: usize = 1000;
/// Below this, a difference between persons' errors is not put down to chance.
const SIGNIFICANT: f64 = 0.05;

/// A prediction without a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BaselineKind {
    /// The mean label of the training images.
    Constant,
    /// The mean label of the training images at the pose's true angle, linear between angles; where all angles are known.
    Angle,
    /// Kernel ridge regression on images of 16 x 16 pixels.
    KernelRidge,
}

impl fmt::Display for BaselineKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Constant => "constant",
            Self::Angle => "mean by true angle",
            Self::KernelRidge => "kernel ridge",
        })
    }
}

/// What a baseline achieves, and how it compares with the network.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Baseline {
    /// Which one.
    pub kind: BaselineKind,
    /// Of the images.
    #[serde(flatten)]
    pub scores: Scores,
    /// Exact one-sided sign-flip test of persons' mean absolute errors: small where the network's are lower.
    pub p_network_better: f64,
}

/// Whether a network is better than every baseline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Its mean absolute error is lower than that of every baseline, each with p < 0.05.
    Better,
    /// It is lower, but could be so by chance.
    NotShown,
    /// It is not lower than that of every baseline.
    NotBetter,
}

/// Baselines on a test set, beside the network's error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Baselines {
    /// Each of them.
    pub baselines: Vec<Baseline>,
    /// Mean absolute error of the network.
    pub network_mae: f64,
    /// Persons whose errors are compared.
    pub persons: usize,
    /// Mean absolute error of labels that vary normally by their `std` about the true ones: no prediction can be expected to err
    /// less. Open where all labels are given without variation.
    pub label_noise_mae: Option<f64>,
    /// Whether the network is better.
    pub verdict: Verdict,
}

impl Baselines {
    /// The baselines of training samples on the tested ones, beside the network's predictions in `rows`, one for each tested sample.
    ///
    /// # Errors
    /// [`EvaluateError`] naming the image that cannot be used; [`DataError::Empty`](crate::data::DataError::Empty) without samples.
    ///
    /// # Panics
    /// If there is not one row for each tested sample.
    pub fn of(training: &[Sample], tested: &[Sample], rows: &[Row]) -> Result<Self, EvaluateError> {
        assert_eq!(tested.len(), rows.len(), "one row for each tested sample");
        let mut predicted = vec![
            (
                BaselineKind::Constant,
                vec![mean_label(training); tested.len()],
            ),
            (BaselineKind::KernelRidge, kernel_ridge(training, tested)?),
        ];
        if let Some(by_angle) = by_angle(training, tested) {
            predicted.insert(1, (BaselineKind::Angle, by_angle));
        }
        let network: Vec<f64> = rows.iter().map(|row| row.prediction).collect();
        let of_network = errors_of_persons(rows, &network);
        let scores = |predictions: &[f64]| {
            let pairs = rows.iter().zip(predictions);
            Scores::of(&pairs.map(|(row, &p)| (row.label, p)).collect::<Vec<_>>())
        };
        let network_mae = scores(&network).mae.unwrap_or(f64::NAN);
        let baseline = |(kind, predictions): &(BaselineKind, Vec<f64>)| {
            let errors = errors_of_persons(rows, predictions);
            let test = sign_flip_permutation(&errors, &of_network);
            Baseline {
                kind: *kind,
                scores: scores(predictions),
                p_network_better: test.map_or(1.0, |test| test.p_one_sided),
            }
        };
        let baselines: Vec<Baseline> = predicted.iter().map(baseline).collect();
        let lower = |baseline: &Baseline| baseline.scores.mae.is_some_and(|mae| network_mae < mae);
        let verdict = if !baselines.iter().all(lower) {
            Verdict::NotBetter
        } else if baselines.iter().any(|b| b.p_network_better >= SIGNIFICANT) {
            Verdict::NotShown
        } else {
            Verdict::Better
        };
        Ok(Self {
            baselines,
            network_mae,
            persons: persons(rows),
            label_noise_mae: label_noise_mae(tested),
            verdict,
        })
    }
}

impl fmt::Display for Baselines {
    /// The verdict in a sentence or two.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mae = self.network_mae;
        let named = |of: &dyn Fn(&Baseline) -> Option<f64>| {
            let named = self.baselines.iter().filter_map(|b| Some((b.kind, of(b)?)));
            let named = named.map(|(kind, value)| format!("{kind} {value:.3}"));
            named.collect::<Vec<_>>().join(", ")
        };
        let persons = ppa_core::text::count(self.persons, "person");
        match self.verdict {
            Verdict::Better => {
                let p = self.baselines.iter().map(|b| b.p_network_better);
                let p = p.fold(0.0, f64::max);
                write!(
                    f,
                    "The network (MAE {mae:.3}) is better than every baseline, p at most {p:.3} over {persons}."
                )
            }
            Verdict::NotShown => {
                let p =
                    named(&|b| (b.p_network_better >= SIGNIFICANT).then_some(b.p_network_better));
                write!(
                    f,
                    "The network's MAE, {mae:.3}, is lower than that of every baseline, but {persons} do not show that it is better: p {p}."
                )
            }
            Verdict::NotBetter => {
                let better = named(&|b| b.scores.mae.filter(|&of| of <= mae));
                write!(
                    f,
                    "The network's MAE, {mae:.3}, is not lower than that of: {better}. The network is not useful on these data."
                )
            }
        }
    }
}

fn mean_label(samples: &[Sample]) -> f64 {
    samples.iter().map(|sample| sample.label).sum::<f64>() / samples.len() as f64
}

fn persons(rows: &[Row]) -> usize {
    let mut persons: Vec<_> = rows.iter().map(|row| (row.dataset, row.patient)).collect();
    persons.sort_unstable();
    persons.dedup();
    persons.len()
}

/// Mean absolute error of each person, or of [`MAX_PAIRS`] groups of persons where there are more.
fn errors_of_persons(rows: &[Row], predictions: &[f64]) -> Vec<f64> {
    let mut errors: BTreeMap<(usize, u32), (f64, f64)> = BTreeMap::new();
    for (row, prediction) in rows.iter().zip(predictions) {
        let (sum, count) = errors.entry((row.dataset, row.patient)).or_default();
        *sum += (row.label - prediction).abs();
        *count += 1.0;
    }
    let errors: Vec<f64> = errors
        .into_values()
        .map(|(sum, count)| sum / count)
        .collect();
    let groups = errors.len().div_ceil(MAX_PAIRS).max(1);
    let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
    errors.chunks(groups).map(mean).collect()
}

/// The mean label of the training samples at each tested angle; `None` unless all angles are known.
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

/// The images of each sample, one after the other, as a small network would see them.
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

/// √(2/π) times the mean standard deviation: the mean absolute value of a normal deviate.
fn label_noise_mae(tested: &[Sample]) -> Option<f64> {
    let mean = tested.iter().map(|sample| sample.label_std).sum::<f64>() / tested.len() as f64;
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
        let varying = |label_std| Sample {
            label_std,
            ..at(0.0, 2.0)
        };
        assert_eq!(label_noise_mae(&[varying(0.0)]), None);
        let found = label_noise_mae(&[varying(0.2), varying(0.4)]).unwrap();
        assert!((found - 0.3 * 0.797_884_560_8).abs() < 1e-9, "{found}");
    }

    #[test]
    fn a_verdict_names_what_the_network_does_not_beat() {
        let baseline = |kind, mae, p_network_better| Baseline {
            kind,
            scores: Scores::of(&[(1.0, 1.0 + mae)]),
            p_network_better,
        };
        let of = |verdict, baselines| Baselines {
            baselines,
            network_mae: 0.25,
            persons: 3,
            label_noise_mae: None,
            verdict,
        };
        let constant = baseline(BaselineKind::Constant, 0.5, 0.125);
        let better = of(Verdict::NotShown, vec![constant.clone()]).to_string();
        assert!(
            better.ends_with("but 3 persons do not show that it is better: p constant 0.125."),
            "{better}"
        );
        let angle = baseline(BaselineKind::Angle, 0.2, 1.0);
        let worse = of(Verdict::NotBetter, vec![constant, angle]).to_string();
        assert!(
            worse.contains("not lower than that of: mean by true angle 0.200."),
            "{worse}"
        );
    }
}
