//! Predictions of a test set averaged over the cameras and frames of each pose.

use std::collections::BTreeMap;

use ppa_dataset::layout::Side;
use ppa_metrics::PoseTriple;
use serde::Serialize;

use super::row::Row;

/// One pose: a row of `poses.csv`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PoseRow {
    /// Number of the dataset, as in [`Row`].
    pub dataset: usize,
    /// N of `patient_N`.
    pub patient: u32,
    /// Side of the limb.
    pub side: Side,
    /// Name of the pose, unique within the limb.
    pub pose: String,
    /// Medial rotation in degrees, if the dataset states it.
    pub angle_deg: Option<f64>,
    /// Number of images of all cameras and frames.
    pub images: usize,
    /// Label of the images.
    pub label: f64,
    /// Mean prediction of the images.
    pub prediction: f64,
    /// Spread of the predictions of the pose's frames: see [`frame_spread`].
    pub frame_spread: Option<f64>,
}

/// Averages predictions by pose, in the order of dataset, person, side and name.
pub fn poses(rows: &[Row]) -> Vec<PoseRow> {
    let mut poses: BTreeMap<_, Vec<&Row>> = BTreeMap::new();
    for row in rows {
        let pose = (row.dataset, row.patient, row.side, &row.pose);
        poses.entry(pose).or_default().push(row);
    }
    let of_pose = |((dataset, patient, side, pose), rows): ((_, _, _, &String), Vec<&Row>)| {
        let mean = |value: fn(&Row) -> f64| {
            rows.iter().map(|row| value(row)).sum::<f64>() / rows.len() as f64
        };
        PoseRow {
            dataset,
            patient,
            side,
            pose: pose.clone(),
            angle_deg: rows[0].angle_deg,
            images: rows.len(),
            // The same for all images. Their mean differs in the last digit, which is no tie for rank correlations.
            label: rows[0].label,
            prediction: mean(|row| row.prediction),
            frame_spread: frame_spread(rows.iter().copied()),
        }
    };
    poses.into_iter().map(of_pose).collect()
}

/// Returns the standard deviation of the predictions of one pose by one camera, pooled over poses and cameras: the root of
/// the sum of all squared deviations divided by the sum of all n - 1. `None` if no pose has two frames of one camera.
pub fn frame_spread<'a>(rows: impl IntoIterator<Item = &'a Row>) -> Option<f64> {
    let mut frames: BTreeMap<_, Vec<f64>> = BTreeMap::new();
    for row in rows {
        let key = (row.dataset, row.patient, row.side, &row.pose, row.camera);
        frames.entry(key).or_default().push(row.prediction);
    }
    let (mut squares, mut degrees) = (0.0, 0);
    for frames in frames.values() {
        let mean = frames.iter().sum::<f64>() / frames.len() as f64;
        squares += frames.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
        degrees += frames.len() - 1;
    }
    (degrees > 0).then(|| (squares / degrees as f64).sqrt())
}

/// Returns the one good (label 1) and two bad poses (label 3) of a limb, from (label, prediction) of all its poses; `None` for a limb with
/// other poses.
pub(crate) fn triple(poses: &[(f64, f64)]) -> Option<PoseTriple> {
    let of = |label: f64| {
        let poses = poses.iter().filter(move |pose| pose.0 == label);
        poses.map(|pose| pose.1).collect::<Vec<_>>()
    };
    match (&of(1.0)[..], &of(3.0)[..]) {
        (&[good], &[b1, b2]) if poses.len() == 3 => Some(PoseTriple {
            good,
            bad: [b1, b2],
        }),
        _ => None,
    }
}

/// Returns the triples of all limbs, as in the paper's clinical dataset; `None` if a limb has other poses.
pub fn triples(poses: &[PoseRow]) -> Option<Vec<PoseTriple>> {
    let mut limbs: BTreeMap<_, Vec<(f64, f64)>> = BTreeMap::new();
    for pose in poses {
        let limb = (pose.dataset, pose.patient, pose.side);
        let pair = (pose.label, pose.prediction);
        limbs.entry(limb).or_default().push(pair);
    }
    limbs.values().map(|poses| triple(poses)).collect()
}

#[cfg(test)]
mod tests {
    use ppa_dataset::layout::View;

    use super::*;

    /// The sum of ten labels of 5/3 divided by ten is not 5/3, as that of six is.
    #[test]
    fn equal_labels_of_poses_are_equal() {
        let row = |pose: &str| Row {
            id: String::new(),
            dataset: 1,
            camera: View::Left,
            patient: 3,
            side: Side::Right,
            pose: pose.to_owned(),
            frame: 0,
            angle_deg: None,
            label: 5.0 / 3.0,
            prediction: 2.0,
            correction_deg: None,
            predicted_correction_deg: None,
        };
        let rows = [vec![row("a"); 10], vec![row("b"); 6]].concat();
        let poses = poses(&rows);
        assert_eq!(poses.len(), 2);
        assert!(poses.iter().all(|pose| pose.label == 5.0 / 3.0));
    }
}
