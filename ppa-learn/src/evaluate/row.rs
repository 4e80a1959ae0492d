//! Rows of `predictions.csv`.

use ppa_dataset::layout::{Side, View};
use serde::{Deserialize, Serialize};

use crate::PosePrediction;
use crate::data::Sample;

/// A prediction and its label. The columns include those that `ppa metrics` and the experiments read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Path of the image from the dataset's root.
    pub id: String,
    /// Number of the dataset in order of appearance, from 1: patients of different datasets are different persons.
    pub dataset: usize,
    /// The camera.
    pub camera: View,
    /// N of `patient_N`.
    pub patient: u32,
    /// Side of the limb.
    pub side: Side,
    /// Name of the pose, unique within the limb.
    pub pose: String,
    /// Number of the frame within pose and camera, from 0.
    pub frame: u32,
    /// Medial rotation in degrees, if the dataset states it.
    pub angle_deg: Option<f64>,
    /// Label: quality from 1 to 3.
    pub label: f64,
    /// The network's prediction.
    pub prediction: f64,
    /// Medial rotation in degrees to the best pose of the limb, if angles are known.
    #[serde(default)]
    pub correction_deg: Option<f64>,
    /// The network's prediction of the correction, if it makes one.
    #[serde(default)]
    pub predicted_correction_deg: Option<f64>,
}

impl Row {
    /// Makes rows from samples and the network's predictions.
    ///
    /// # Panics
    /// If there is not one prediction for each sample.
    pub fn of(samples: &[Sample], predictions: &[PosePrediction]) -> Vec<Self> {
        assert_eq!(
            samples.len(),
            predictions.len(),
            "one prediction for each sample"
        );
        let mut datasets = Vec::new();
        for sample in samples {
            if !datasets.contains(&&sample.dataset) {
                datasets.push(&sample.dataset);
            }
        }
        let number = |sample: &Sample| datasets.iter().position(|&d| *d == sample.dataset);
        let row = |(sample, prediction): (&Sample, &PosePrediction)| Self {
            id: sample.id.clone(),
            dataset: 1 + number(sample).expect("all datasets are numbered"),
            camera: sample.camera,
            patient: sample.limb.patient,
            side: sample.limb.side,
            pose: sample.pose.clone(),
            frame: sample.frame,
            angle_deg: sample.angle_deg,
            label: sample.label,
            prediction: prediction.quality,
            correction_deg: sample.correction_deg,
            predicted_correction_deg: prediction.correction_deg,
        };
        samples.iter().zip(predictions).map(row).collect()
    }
}
