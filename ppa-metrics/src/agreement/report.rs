//! All statistics of the agreement of readers, from their grades by image.

use std::collections::BTreeMap;

use serde::Serialize;

use super::icc::{IccForms, icc};
use super::kappa::{KappaWeights, weighted_kappa};
use super::krippendorff::{Measurement, krippendorff_alpha};
use super::ratings::Ratings;
use super::readers::{
    ReaderError, RepeatAgreement, disagreements, reader_errors, repeat_agreement,
};
use crate::error::MetricError;

/// Number of listed images with the largest disagreement.
const MOST_DISAGREEMENTS: usize = 10;

/// For each image by name, the first grade of each reader by name, and the second, if any.
pub type GradesByImage = BTreeMap<String, BTreeMap<String, (f64, Option<f64>)>>;

/// Agreement of readers. Second grades of an image only count for `against_self`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AgreementReport {
    /// Images that any reader graded.
    pub images: usize,
    /// The readers, by name.
    pub readers: Vec<ReaderReport>,
    /// Intraclass correlations over the images that every reader graded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub icc: Option<IccForms>,
    /// Krippendorff's α of ordinal grades.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha_ordinal: Option<f64>,
    /// Krippendorff's α of grades on an interval scale.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha_interval: Option<f64>,
    /// All pairs of readers.
    pub pairs: Vec<PairReport>,
    /// At most ten images, widest disagreement first.
    pub largest_disagreements: Vec<ImageDisagreement>,
    /// Undefined statistics, and why.
    pub undefined: Vec<String>,
}

/// One reader.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReaderReport {
    /// Name.
    pub name: String,
    /// Images that this reader graded.
    pub images: usize,
    /// Against the mean of the others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub against_others: Option<ReaderError>,
    /// On the images that this reader graded twice.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub against_self: Option<RepeatAgreement>,
}

/// Two readers, on the images that both graded.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PairReport {
    /// Their names.
    pub readers: [String; 2],
    /// Number of these images.
    pub images: usize,
    /// κ with linear weights.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kappa_linear: Option<f64>,
    /// κ with quadratic weights.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kappa_quadratic: Option<f64>,
}

/// An image on which readers differ.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImageDisagreement {
    /// Its name.
    pub image: String,
    /// Best grade.
    pub lowest: f64,
    /// Worst grade.
    pub highest: f64,
    /// Standard deviation over the readers, as in [`Disagreement`](super::Disagreement).
    pub std: f64,
}

/// Computes all statistics of the agreement of readers; those without a value are named in `undefined`.
///
/// # Errors
/// [`MetricError`] for fewer than two images or readers, and for grades that are not finite.
pub fn agreement_report(grades: &GradesByImage) -> Result<AgreementReport, MetricError> {
    let mut names: Vec<&String> = grades.values().flat_map(BTreeMap::keys).collect();
    names.sort_unstable();
    names.dedup();
    let row = |of_image: &BTreeMap<String, (f64, Option<f64>)>| {
        let grade = |name: &&String| of_image.get(*name).map(|grades| grades.0);
        names.iter().map(grade).collect()
    };
    let ratings = Ratings::new(grades.values().map(row).collect())?;
    let mut undefined = Vec::new();
    let mut or_reason = |what: String, value: Result<f64, MetricError>| {
        value
            .map_err(|error| undefined.push(format!("{what}: {error}")))
            .ok()
    };
    let mut alpha = |name: &str, measurement| {
        or_reason(name.to_owned(), krippendorff_alpha(&ratings, measurement))
    };
    let alpha_ordinal = alpha("alpha, ordinal", Measurement::Ordinal);
    let alpha_interval = alpha("alpha, interval", Measurement::Interval);
    let mut pairs = Vec::new();
    for first in 0..names.len() {
        for second in first + 1..names.len() {
            let (a, b) = ratings.common(first, second);
            let readers = [names[first].clone(), names[second].clone()];
            let mut kappa = |name: &str, weights| {
                let what = format!("{name} kappa of {} and {}", readers[0], readers[1]);
                or_reason(what, weighted_kappa(&a, &b, weights))
            };
            pairs.push(PairReport {
                images: a.len(),
                kappa_linear: kappa("linear", KappaWeights::Linear),
                kappa_quadratic: kappa("quadratic", KappaWeights::Quadratic),
                readers,
            });
        }
    }
    let icc = icc(&ratings)
        .map_err(|error| undefined.push(format!("intraclass correlation: {error}")))
        .ok();
    let readers = names.iter().zip(reader_errors(&ratings));
    let images: Vec<&String> = grades.keys().collect();
    let widest = disagreements(&ratings).into_iter().take(MOST_DISAGREEMENTS);
    Ok(AgreementReport {
        images: grades.len(),
        readers: readers
            .map(|(name, against_others)| ReaderReport {
                images: grades.values().filter(|of| of.contains_key(*name)).count(),
                against_self: against_self(grades, name),
                name: (*name).clone(),
                against_others,
            })
            .collect(),
        icc,
        alpha_ordinal,
        alpha_interval,
        pairs,
        largest_disagreements: widest
            .map(|found| ImageDisagreement {
                image: images[found.subject].clone(),
                lowest: found.lowest,
                highest: found.highest,
                std: found.std,
            })
            .collect(),
        undefined,
    })
}

fn against_self(grades: &GradesByImage, reader: &str) -> Option<RepeatAgreement> {
    let twice = |of_image: &BTreeMap<String, (f64, Option<f64>)>| {
        let (first, second) = of_image.get(reader)?;
        second.map(|second| (*first, second))
    };
    let (first, second): (Vec<f64>, Vec<f64>) = grades.values().filter_map(twice).unzip();
    repeat_agreement(&first, &second).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeats_count_for_their_reader_only() {
        let of = |a: (f64, Option<f64>), b: f64| {
            BTreeMap::from([("a".to_owned(), a), ("b".to_owned(), (b, None))])
        };
        let mut grades = GradesByImage::from([
            ("x".to_owned(), of((1.0, None), 1.0)),
            ("y".to_owned(), of((2.0, None), 2.5)),
            ("z".to_owned(), of((3.0, None), 3.0)),
        ]);
        let once = agreement_report(&grades).unwrap();
        grades.insert("y".to_owned(), of((2.0, Some(3.0)), 2.5));
        let twice = agreement_report(&grades).unwrap();
        assert_eq!(once.readers[0].against_self, None);
        assert_eq!(twice.readers[0].against_self.unwrap().mae, 1.0);
        assert_eq!((once.pairs, once.icc), (twice.pairs, twice.icc));
        assert_eq!(twice.largest_disagreements[0].image, "y");
        assert_eq!(twice.undefined, Vec::<String>::new());
    }
}
