//! Samples of training and evaluation, and the split between them.

use std::collections::BTreeSet;
use std::path::PathBuf;

use ppa_core::Roi;
use ppa_dataset::layout::{LimbId, View};

use super::error::DataError;
use super::prepare::prepare;
use super::raster::Raster;

/// A depth image on disk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SampleImage {
    /// 16-bit PNG in mm.
    pub path: PathBuf,
    /// The camera.
    pub camera: View,
    /// Region of interest around the joint.
    pub roi: Roi,
    /// Columns and rows of the camera's images.
    pub size: [usize; 2],
    /// Whether the network sees the image mirrored left to right.
    pub mirrored: bool,
}

impl SampleImage {
    /// Reads and prepares the image for a network of `side` x `side` inputs.
    ///
    /// # Errors
    /// [`DataError`] naming the file if it cannot be read, has another size, or its region is outside the image.
    pub fn load(&self, side: usize) -> Result<Raster<u16>, DataError> {
        let image = ppa_dataset::published::GrayImage16::read(&self.path)?;
        let found = [image.width as usize, image.height as usize];
        if found != self.size {
            return Err(DataError::Size {
                path: self.path.clone(),
                found,
                expected: self.size,
            });
        }
        let of_region = |source| DataError::Region {
            path: self.path.clone(),
            source: Box::new(source),
        };
        let depth = Raster::new(found[0], found[1], image.pixels).map_err(of_region)?;
        prepare(&depth, self.roi, self.mirrored, side).map_err(of_region)
    }
}

/// Input of a network, an image of one camera or of both, and the label to predict. The cameras are exchanged for a left limb that is
/// shown as a right one.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Path of its first image from the dataset's root.
    pub id: String,
    /// One image, or the images for the left and the right input.
    pub images: Vec<SampleImage>,
    /// Quality from 1 (ideal) to 3 (inadequate); NaN without a label, see [`Selection::unlabelled`](super::Selection::unlabelled).
    pub label: f64,
    /// Standard deviation of the label over the readers, or over the assumptions made.
    pub label_std: f64,
    /// Canonical path of the dataset's folder. Persons of different datasets are different persons.
    pub dataset: PathBuf,
    /// N of `patient_N`, and which of the person's limbs.
    pub limb: LimbId,
    /// The camera of its first image.
    pub camera: View,
    /// Name of the pose, equal only for samples of one pose (all cameras and frames).
    pub pose: String,
    /// Number of the frame within pose and camera, from 0.
    pub frame: u32,
    /// Medial rotation in degrees, if the dataset states it.
    pub angle_deg: Option<f64>,
    /// Medial rotation in degrees from the pose to the best one of its limb according to the labels of the limb's samples, if the angles
    /// are known.
    pub correction_deg: Option<f64>,
}

/// Refuses a split with images of the same person in training and in evaluation.
///
/// # Errors
/// [`DataError::Leak`] naming the first such person.
pub fn check_split(training: &[Sample], evaluation: &[Sample]) -> Result<(), DataError> {
    let person = |sample: &'_ Sample| (sample.dataset.clone(), sample.limb.patient);
    let persons: BTreeSet<_> = training.iter().map(person).collect();
    match evaluation.iter().find(|s| persons.contains(&person(s))) {
        Some(sample) => {
            let (dataset, patient) = (sample.dataset.display(), sample.limb.patient);
            Err(DataError::Leak(format!("{dataset}, patient {patient}")))
        }
        None => Ok(()),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use ppa_dataset::layout::Side;

    use super::*;

    /// A sample without images.
    pub fn sample(label: f64, number: u32) -> Sample {
        Sample {
            id: format!("sample {number}"),
            images: Vec::new(),
            label,
            label_std: 0.0,
            dataset: PathBuf::from("data"),
            limb: LimbId {
                patient: number,
                side: Side::Left,
            },
            camera: View::Left,
            pose: format!("pose {number}"),
            frame: 0,
            angle_deg: None,
            correction_deg: None,
        }
    }

    #[test]
    fn a_person_is_on_one_side_of_a_split() {
        let [first, second] = [sample(1.0, 1), sample(2.0, 2)];
        let split = |training: &Sample, evaluation: &Sample| {
            check_split(
                std::slice::from_ref(training),
                std::slice::from_ref(evaluation),
            )
        };
        assert!(split(&first, &second).is_ok());
        let other_foot = Sample {
            limb: LimbId {
                side: Side::Right,
                ..first.limb
            },
            ..first.clone()
        };
        let elsewhere = Sample {
            dataset: PathBuf::from("other"),
            ..first.clone()
        };
        assert!(split(&first, &elsewhere).is_ok());
        let error = split(&first, &other_foot).unwrap_err().to_string();
        assert!(
            error.starts_with("data, patient 1 would be in both training"),
            "{error}"
        );
    }
}
