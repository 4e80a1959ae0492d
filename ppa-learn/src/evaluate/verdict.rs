//! Verdict on whether a network is better than the baselines, and its wording.

use std::collections::BTreeMap;
use std::fmt;

use ppa_metrics::{MAX_PAIRS, PermutationTest, sign_flip_permutation};
use serde::{Deserialize, Serialize};

/// Significance level of differences between persons' errors.
const SIGNIFICANT: f64 = 0.05;

/// A prediction without a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BaselineKind {
    /// The mean label of the training images.
    Constant,
    /// The mean label of the training images at the pose's true angle, interpolated linearly between angles; only if all angles are known.
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

/// Whether a network is better than every baseline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Its mean absolute error is lower than that of every baseline, each with p < 0.05.
    Better,
    /// It is lower, but not significantly.
    NotShown,
    /// It is not lower than that of every baseline.
    NotBetter,
}

/// A baseline's error, and the significance of the network's lower one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Compared {
    /// Kind of baseline.
    pub kind: BaselineKind,
    /// Its mean absolute error; NaN if it is not defined.
    pub mae: f64,
    /// p-value of an exact one-sided sign-flip test of persons' mean absolute errors: small if the network's are lower.
    pub p_network_better: f64,
}

/// Returns the p-value of [`Compared::p_network_better`]; 1 if there is no pair.
pub(crate) fn p_network_better(baseline: &[f64], network: &[f64]) -> f64 {
    test_of_persons(baseline, network).map_or(1.0, |test| test.p_one_sided)
}

/// Runs the exact paired sign-flip test of persons' mean absolute errors; `None` if there is no pair.
///
/// More than [`MAX_PAIRS`] persons are averaged in groups of equal size, except the last.
pub(crate) fn test_of_persons(first: &[f64], second: &[f64]) -> Option<PermutationTest> {
    let groups = |errors: &[f64]| -> Vec<f64> {
        let size = errors.len().div_ceil(MAX_PAIRS).max(1);
        let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
        errors.chunks(size).map(mean).collect()
    };
    sign_flip_permutation(&groups(first), &groups(second)).ok()
}

/// Returns the mean of each key's values.
pub(crate) fn mean_by<K: Ord>(pairs: impl Iterator<Item = (K, f64)>) -> BTreeMap<K, f64> {
    let mut sums: BTreeMap<K, (f64, f64)> = BTreeMap::new();
    for (key, value) in pairs {
        let (sum, count) = sums.entry(key).or_default();
        *sum += value;
        *count += 1.0;
    }
    let mean = |(key, (sum, count))| (key, sum / count);
    sums.into_iter().map(mean).collect()
}

/// Returns the verdict on a network with this mean absolute error.
pub(crate) fn verdict(network_mae: f64, baselines: &[Compared]) -> Verdict {
    if !baselines.iter().all(|b| network_mae < b.mae) {
        Verdict::NotBetter
    } else if baselines.iter().any(|b| b.p_network_better >= SIGNIFICANT) {
        Verdict::NotShown
    } else {
        Verdict::Better
    }
}

/// Returns the verdict in one or two sentences.
pub(crate) fn sentence(network_mae: f64, baselines: &[Compared], persons: usize) -> String {
    let named = |of: &dyn Fn(&Compared) -> Option<f64>| {
        let named = baselines.iter().filter_map(|b| Some((b.kind, of(b)?)));
        let named = named.map(|(kind, value)| format!("{kind} {value:.3}"));
        named.collect::<Vec<_>>().join(", ")
    };
    let persons = ppa_core::text::count(persons, "person");
    match verdict(network_mae, baselines) {
        Verdict::Better => {
            let p = baselines.iter().map(|b| b.p_network_better);
            let p = p.fold(0.0, f64::max);
            // Rounded up, since it is a bound.
            let p = (1000.0 * p).ceil() / 1000.0;
            format!(
                "The network (MAE {network_mae:.3}) is better than every baseline, p at most {p:.3} over {persons}."
            )
        }
        Verdict::NotShown => {
            let p = named(&|b| (b.p_network_better >= SIGNIFICANT).then_some(b.p_network_better));
            format!(
                "The network's MAE, {network_mae:.3}, is lower than that of every baseline, but the difference is not \
                 significant over {persons}: p {p}."
            )
        }
        Verdict::NotBetter => {
            let better = named(&|b| Some(b.mae).filter(|&of| of <= network_mae));
            format!(
                "The network's MAE, {network_mae:.3}, is not lower than that of: {better}. The network is not useful on these data."
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_verdict_names_what_the_network_does_not_beat() {
        let compared = |kind, mae, p_network_better| Compared {
            kind,
            mae,
            p_network_better,
        };
        let constant = compared(BaselineKind::Constant, 0.5, 0.125);
        assert_eq!(verdict(0.25, &[constant]), Verdict::NotShown);
        let better = sentence(0.25, &[constant], 3);
        assert!(
            better.ends_with(
                "but the difference is not significant over 3 persons: p constant 0.125."
            ),
            "{better}"
        );
        let angle = compared(BaselineKind::Angle, 0.2, 1.0);
        assert_eq!(verdict(0.25, &[angle]), Verdict::NotBetter);
        let worse = sentence(0.25, &[constant, angle], 3);
        assert!(
            worse.contains("not lower than that of: mean by true angle 0.200."),
            "{worse}"
        );
        let surely = compared(BaselineKind::KernelRidge, 0.3, 0.0313);
        assert_eq!(verdict(0.25, &[surely]), Verdict::Better);
        let better = sentence(0.25, &[surely], 5);
        assert!(
            better.ends_with("p at most 0.032 over 5 persons."),
            "{better}"
        );
    }

    #[test]
    fn many_persons_are_tested_in_groups() {
        let [few, many] =
            [5, 3 * MAX_PAIRS - 1].map(|n| p_network_better(&vec![0.5; n], &vec![0.25; n]));
        assert_eq!(few, 1.0 / 32.0);
        assert_eq!(many, 0.5_f64.powi(MAX_PAIRS as i32));
        assert_eq!(p_network_better(&[], &[]), 1.0);
    }
}
