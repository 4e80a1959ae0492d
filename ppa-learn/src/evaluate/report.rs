//! Report on the predictions for a test set.

use std::collections::BTreeMap;

use ppa_metrics::ConstantPrediction;
use serde::Serialize;

use super::baselines::Baselines;
use super::correction::CorrectionScores;
use super::error::EvaluateError;
use super::means::means;
use super::poses::{PoseRow, frame_spread, poses, triples};
use super::row::Row;
use super::scores::Scores;

/// Bin width of the calibration by prediction.
const BIN: f64 = 0.25;

/// Metrics of a test set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evaluation {
    /// Set if the predictions of the images hardly differ: all metrics are then those of a constant.
    pub constant_prediction: Option<ConstantPrediction>,
    /// Scores over single images.
    pub images: Scores,
    /// Scores over poses, whose predictions are averaged over cameras and frames.
    pub poses: Scores,
    /// Spread of the predictions of a pose's frames: see [`frame_spread`].
    pub frame_spread: Option<f64>,
    /// Pose Delta; `None` unless every limb has one pose of label 1 and two of label 3.
    pub pose_delta: Option<f64>,
    /// Pose Margin Accuracy; `None` if Pose Delta is.
    pub pose_margin_accuracy: Option<f64>,
    /// Scores over the poses of each person.
    pub persons: Vec<PersonScores>,
    /// Numbers of images by class of the label (row) and of the prediction (column): the nearest of 1, 2 and 3; halves are rounded up.
    pub confusion: [[usize; 3]; 3],
    /// The same in half steps: 1, 1.5, 2, 2.5 or 3.
    pub confusion_half_steps: [[usize; 5]; 5],
    /// (label, mean prediction, images) of each label that occurs.
    pub calibration: Vec<(f64, f64, usize)>,
    /// (mean label, mean prediction, images) of the images whose predictions are in one quarter: 1 to 1.25, 1.25 to 1.5, ….
    pub calibration_by_prediction: Vec<(f64, f64, usize)>,
    /// (degrees, mean absolute error, images) of each angle that the dataset states.
    pub error_by_angle: Vec<(f64, f64, usize)>,
    /// Errors of corrections, if the network predicts them and they are known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub correction: Option<CorrectionScores>,
    /// Baselines without a network, if they were computed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub baselines: Option<Baselines>,
}

/// Metrics of one person's poses.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PersonScores {
    /// Number of the dataset, as in [`Row`].
    pub dataset: usize,
    /// N of `patient_N`.
    pub patient: u32,
    /// Scores over the poses.
    #[serde(flatten)]
    pub scores: Scores,
}

impl Evaluation {
    /// Computes the metrics of predictions, without baselines.
    ///
    /// # Errors
    /// [`EvaluateError::NotFinite`] naming the first image whose prediction is not finite.
    pub fn of(rows: &[Row]) -> Result<Self, EvaluateError> {
        if let Some(row) = rows.iter().find(|row| !row.prediction.is_finite()) {
            return Err(EvaluateError::NotFinite {
                image: row.id.clone(),
                prediction: row.prediction,
            });
        }
        let pairs: Vec<(f64, f64)> = rows.iter().map(|row| (row.label, row.prediction)).collect();
        let poses = poses(rows);
        let pose_pair = |pose: &PoseRow| (pose.label, pose.prediction);
        let mut persons: BTreeMap<(usize, u32), Vec<(f64, f64)>> = BTreeMap::new();
        for pose in &poses {
            let person = (pose.dataset, pose.patient);
            persons.entry(person).or_default().push(pose_pair(pose));
        }
        let of_person = |(&(dataset, patient), pairs): (&_, &Vec<_>)| PersonScores {
            dataset,
            patient,
            scores: Scores::of(pairs),
        };
        let triples = triples(&poses).unwrap_or_default();
        let errors = rows.iter().filter_map(|row| {
            let error = (row.prediction - row.label).abs();
            Some((row.angle_deg?, error))
        });
        let poses: Vec<_> = poses.iter().map(pose_pair).collect();
        let (labels, predictions): (Vec<_>, Vec<_>) = pairs.iter().copied().unzip();
        Ok(Self {
            constant_prediction: ppa_metrics::constant_prediction(&labels, &predictions)
                .ok()
                .flatten(),
            images: Scores::of(&pairs),
            poses: Scores::of(&poses),
            frame_spread: frame_spread(rows),
            pose_delta: ppa_metrics::pose_delta(&triples).ok(),
            pose_margin_accuracy: ppa_metrics::pose_margin_accuracy(&triples).ok(),
            persons: persons.iter().map(of_person).collect(),
            confusion: confusion(&pairs),
            confusion_half_steps: confusion(&pairs),
            calibration: means(pairs.iter().copied()),
            calibration_by_prediction: by_prediction(&pairs),
            error_by_angle: means(errors),
            correction: CorrectionScores::of(rows),
            baselines: None,
        })
    }
}

/// Counts pairs of label (row) and prediction (column) in N classes from 1 to 3.
fn confusion<const N: usize>(pairs: &[(f64, f64)]) -> [[usize; N]; N] {
    let last = (N - 1) as f64;
    let class = |quality: f64| {
        ((quality - 1.0) * last / 2.0 + 0.5)
            .floor()
            .clamp(0.0, last)
    };
    let mut table = [[0; N]; N];
    for &(label, prediction) in pairs {
        table[class(label) as usize][class(prediction) as usize] += 1;
    }
    table
}

/// Returns mean label, mean prediction and number of pairs for each bin of predictions.
fn by_prediction(pairs: &[(f64, f64)]) -> Vec<(f64, f64, usize)> {
    let bin = |pair: &(f64, f64)| (pair.1 / BIN).floor();
    let labels = means(pairs.iter().map(|pair| (bin(pair), pair.0)));
    let predictions = means(pairs.iter().map(|pair| (bin(pair), pair.1)));
    let both = labels.into_iter().zip(predictions);
    both.map(|((_, label, n), (_, prediction, _))| (label, prediction, n))
        .collect()
}

#[cfg(test)]
mod tests {
    use ppa_dataset::layout::{Side, View};

    use super::*;

    fn row(patient: u32, pose: &str, label: f64, prediction: f64) -> Row {
        Row {
            id: String::new(),
            dataset: 1,
            camera: View::Left,
            patient,
            side: Side::Left,
            pose: pose.to_owned(),
            frame: 0,
            angle_deg: (patient == 1).then_some(10.0),
            label,
            prediction,
            correction_deg: None,
            predicted_correction_deg: None,
        }
    }

    #[test]
    fn images_poses_and_persons_by_hand() {
        let rows = [
            row(1, "a", 1.0, 1.0),
            row(1, "a", 1.0, 2.0),
            row(1, "b", 3.0, 3.5),
            row(2, "a", 2.5, 1.5),
        ];
        let evaluation = Evaluation::of(&rows).unwrap();
        assert_eq!(evaluation.images.n, 4);
        assert_eq!(evaluation.images.mae, Some((0.0 + 1.0 + 0.5 + 1.0) / 4.0));
        // The mean of pose a of person 1 is 1.5; pose a of person 2 is a different pose.
        assert_eq!(evaluation.poses.n, 3);
        assert_eq!(evaluation.poses.mae, Some((0.5 + 0.5 + 1.0) / 3.0));
        assert_eq!(evaluation.poses.sensitivity, Some(0.5));
        let [first, second] = &evaluation.persons[..] else {
            panic!("two persons")
        };
        assert_eq!((first.patient, first.scores.mae), (1, Some(0.5)));
        assert_eq!((second.scores.n, second.scores.spearman), (1, None));
        // 1 and 2: (0.5² + 0.5²) / (2 - 1).
        assert_eq!(evaluation.frame_spread, Some(0.5_f64.sqrt()));
        assert_eq!(evaluation.pose_delta, None);
        assert_eq!(evaluation.confusion, [[1, 1, 0], [0, 0, 0], [0, 1, 1]]);
        let calibration = [(1.0, 1.5, 2), (2.5, 1.5, 1), (3.0, 3.5, 1)];
        assert_eq!(evaluation.calibration, calibration);
        let halves = evaluation.confusion_half_steps;
        assert_eq!([halves[0], halves[3]], [[1, 0, 1, 0, 0], [0, 1, 0, 0, 0]]);
        let by_prediction = [(1.0, 1.0, 1), (2.5, 1.5, 1), (1.0, 2.0, 1), (3.0, 3.5, 1)];
        assert_eq!(evaluation.calibration_by_prediction, by_prediction);
        assert_eq!(evaluation.error_by_angle, [(10.0, 0.5, 3)]);
    }

    #[test]
    fn patients_of_two_datasets_are_different_persons() {
        let first = row(1, "a", 1.0, 1.0);
        let second = Row {
            dataset: 2,
            ..row(1, "a", 3.0, 2.0)
        };
        let evaluation = Evaluation::of(&[first, second]).unwrap();
        assert_eq!((evaluation.poses.n, evaluation.frame_spread), (2, None));
        let [first, second] = &evaluation.persons[..] else {
            panic!("two persons")
        };
        assert_eq!((first.dataset, first.scores.mae), (1, Some(0.0)));
        assert_eq!((second.dataset, second.scores.mae), (2, Some(1.0)));
    }

    #[test]
    fn a_limb_of_one_good_and_two_bad_poses_has_a_pose_delta() {
        let rows = [
            row(1, "a", 1.0, 1.0),
            row(1, "a", 1.0, 2.0),
            row(1, "b", 3.0, 2.0),
            row(1, "c", 3.0, 3.0),
        ];
        let evaluation = Evaluation::of(&rows).unwrap();
        assert_eq!(evaluation.pose_delta, Some(2.5 - 1.5));
        assert_eq!(evaluation.pose_margin_accuracy, Some(1.0));
        assert_eq!(Evaluation::of(&rows[..3]).unwrap().pose_delta, None);
    }

    #[test]
    fn a_network_that_answers_with_a_constant_is_reported() {
        let rows = [row(1, "a", 1.0, 1.999), row(1, "b", 3.0, 2.001)];
        let evaluation = Evaluation::of(&rows).unwrap();
        assert_eq!(evaluation.constant_prediction.unwrap().mean, 2.0);
        let rows = [row(1, "a", 1.0, 1.9), row(1, "b", 3.0, 2.1)];
        assert_eq!(Evaluation::of(&rows).unwrap().constant_prediction, None);
        assert_eq!(Evaluation::of(&[]).unwrap().constant_prediction, None);
    }

    #[test]
    fn a_prediction_that_is_not_finite_is_named() {
        let rows = [row(1, "a", 1.0, 1.0), row(1, "b", 1.0, f64::NAN)];
        let error = Evaluation::of(&rows).unwrap_err().to_string();
        assert!(error.ends_with("the prediction is NaN, expected a finite number"));
    }
}
