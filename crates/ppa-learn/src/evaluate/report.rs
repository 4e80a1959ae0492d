//! All that is said of the predictions on a test set.

use std::collections::BTreeMap;

use serde::Serialize;

use super::row::Row;
use super::scores::Scores;

/// Metrics of a test set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evaluation {
    /// Every image by itself.
    pub images: Scores,
    /// Predictions averaged over cameras and frames of a pose.
    pub poses: Scores,
    /// The poses of each person.
    pub persons: Vec<PersonScores>,
    /// Numbers of images by class of the label (row) and of the prediction (column): 1, 2 or 3, the nearest; halves go up.
    pub confusion: [[usize; 3]; 3],
    /// (label, mean prediction, images) of each label that occurs.
    pub calibration: Vec<(f64, f64, usize)>,
    /// (degrees, mean absolute error, images) of each angle that the dataset tells.
    pub error_by_angle: Vec<(f64, f64, usize)>,
}

/// Metrics of one person's poses.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PersonScores {
    /// N of `patient_N`.
    pub patient: u32,
    /// Of the poses.
    #[serde(flatten)]
    pub scores: Scores,
}

impl Evaluation {
    /// The metrics of some predictions.
    pub fn of(rows: &[Row]) -> Self {
        let pairs: Vec<(f64, f64)> = rows.iter().map(|row| (row.label, row.prediction)).collect();
        let mut poses: BTreeMap<(u32, &str), Vec<&Row>> = BTreeMap::new();
        for row in rows {
            let pose = (row.patient, row.pose.as_str());
            poses.entry(pose).or_default().push(row);
        }
        let mut persons: BTreeMap<u32, Vec<(f64, f64)>> = BTreeMap::new();
        for ((patient, _), rows) in &poses {
            let mean = |value: fn(&Row) -> f64| {
                rows.iter().map(|row| value(row)).sum::<f64>() / rows.len() as f64
            };
            let pair = (mean(|row| row.label), mean(|row| row.prediction));
            persons.entry(*patient).or_default().push(pair);
        }
        let all_poses: Vec<(f64, f64)> = persons.values().flatten().copied().collect();
        let mut confusion = [[0; 3]; 3];
        for (label, prediction) in &pairs {
            confusion[class(*label)][class(*prediction)] += 1;
        }
        let of_person = |(&patient, pairs): (&u32, &Vec<(f64, f64)>)| PersonScores {
            patient,
            scores: Scores::of(pairs),
        };
        let errors = rows.iter().filter_map(|row| {
            let error = (row.prediction - row.label).abs();
            Some((row.angle_deg?, error))
        });
        Self {
            images: Scores::of(&pairs),
            poses: Scores::of(&all_poses),
            persons: persons.iter().map(of_person).collect(),
            confusion,
            calibration: means(pairs.iter().copied()),
            error_by_angle: means(errors),
        }
    }
}

/// 0, 1 or 2 for qualities next to 1, 2 or 3.
fn class(quality: f64) -> usize {
    ((quality + 0.5).floor().clamp(1.0, 3.0) - 1.0) as usize
}

/// The mean value of each key, and how many there are.
fn means(pairs: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64, usize)> {
    let mut pairs: Vec<(f64, f64)> = pairs.collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let of_key = |same: &[(f64, f64)]| {
        let sum: f64 = same.iter().map(|pair| pair.1).sum();
        (same[0].0, sum / same.len() as f64, same.len())
    };
    pairs.chunk_by(|a, b| a.0 == b.0).map(of_key).collect()
}

#[cfg(test)]
mod tests {
    use ppa_dataset::layout::{Side, View};

    use super::*;

    fn row(patient: u32, pose: &str, label: f64, prediction: f64) -> Row {
        Row {
            id: String::new(),
            camera: View::Left,
            patient,
            side: Side::Left,
            pose: pose.to_owned(),
            frame: 0,
            angle_deg: (patient == 1).then_some(10.0),
            label,
            prediction,
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
        let evaluation = Evaluation::of(&rows);
        assert_eq!(evaluation.images.n, 4);
        assert_eq!(evaluation.images.mae, Some((0.0 + 1.0 + 0.5 + 1.0) / 4.0));
        // Pose a of person 1 is 1.5 on average; pose a of person 2 is another one.
        assert_eq!(evaluation.poses.n, 3);
        assert_eq!(evaluation.poses.mae, Some((0.5 + 0.5 + 1.0) / 3.0));
        assert_eq!(evaluation.poses.sensitivity, Some(0.5));
        let [first, second] = &evaluation.persons[..] else {
            panic!("two persons")
        };
        assert_eq!((first.patient, first.scores.mae), (1, Some(0.5)));
        assert_eq!((second.scores.n, second.scores.spearman), (1, None));
        assert_eq!(evaluation.confusion, [[1, 1, 0], [0, 0, 0], [0, 1, 1]]);
        let calibration = [(1.0, 1.5, 2), (2.5, 1.5, 1), (3.0, 3.5, 1)];
        assert_eq!(evaluation.calibration, calibration);
        assert_eq!(evaluation.error_by_angle, [(10.0, 0.5, 3)]);
    }
}
