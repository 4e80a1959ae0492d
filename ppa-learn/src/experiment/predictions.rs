//! Predictions of the networks of both views on their test images.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use ppa_dataset::layout::{LimbId, Side};
use ppa_metrics::{MetricError, PoseTriple, mean_per_pose};
use serde::{Deserialize, Serialize};

use super::error::ExperimentError;
use crate::evaluate::{Row, triple};

/// Identity of a depth image of a test set without its camera: both cameras see the same moment.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Moment {
    /// N of `patient_N`.
    pub patient: u32,
    /// Side of the limb.
    pub side: Side,
    /// Name of the pose, unique within the limb.
    pub pose: String,
    /// Number of the frame within the pose, from 0.
    pub frame: u32,
}

/// The prediction of one network for one image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Prediction {
    /// N of `patient_N`.
    pub patient: u32,
    /// Side of the limb.
    pub side: Side,
    /// Name of the pose, unique within the limb.
    pub pose: String,
    /// Number of the frame within the pose, from 0.
    pub frame: u32,
    /// Medial rotation in degrees, if the dataset states it.
    #[serde(default)]
    pub angle_deg: Option<f64>,
    /// Quality given by readers, 1 to 3.
    pub label: f64,
    /// Quality predicted by the network.
    pub prediction: f64,
}

/// Error in joining or evaluating the predictions of two views.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PredictionError {
    /// Two predictions of one view for one image.
    #[error("{0} is predicted twice in one view")]
    Twice(Moment),
    /// Only one of the views has the image.
    #[error("{0} is predicted in one view only")]
    OneView(Moment),
    /// The views do not agree on the label.
    #[error("{moment} has the label {first} in one view and {second} in the other")]
    Label {
        /// The image.
        moment: Moment,
        /// Label in the first view.
        first: f64,
        /// Label in the second view.
        second: f64,
    },
    /// A limb without one good and two bad poses.
    #[error("patient {} {} has {good} poses of label 1 and {bad} of label 3, expected 1 and 2", limb.patient, limb.side_letter())]
    NoTriple {
        /// The limb.
        limb: LimbId,
        /// Poses of label 1.
        good: usize,
        /// Poses of label 3.
        bad: usize,
    },
    /// A metric that is not defined.
    #[error(transparent)]
    Metric(#[from] MetricError),
}

impl fmt::Display for Moment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            patient,
            side,
            pose,
            frame,
        } = self;
        write!(
            f,
            "patient {patient} {}, pose {pose}, frame {frame}",
            side.letter()
        )
    }
}

impl Prediction {
    /// Returns the moment of the image.
    pub fn moment(&self) -> Moment {
        Moment {
            patient: self.patient,
            side: self.side,
            pose: self.pose.clone(),
            frame: self.frame,
        }
    }
}

/// Drops the camera.
impl From<Row> for Prediction {
    fn from(row: Row) -> Self {
        Self {
            patient: row.patient,
            side: row.side,
            pose: row.pose,
            frame: row.frame,
            angle_deg: row.angle_deg,
            label: row.label,
            prediction: row.prediction,
        }
    }
}

/// Returns label and prediction of each moment, the mean of the two views: y_j = (y_j^V1 + y_j^V2) / 2 (paper, section 4.4).
///
/// # Errors
/// [`PredictionError`] if the views do not have the same moments and labels.
pub fn join_views(
    first: &[Prediction],
    second: &[Prediction],
) -> Result<Vec<Prediction>, PredictionError> {
    let mut others = by_moment(second)?;
    let mut joined = Vec::with_capacity(first.len());
    for (moment, one) in by_moment(first)? {
        let Some(other) = others.remove(&moment) else {
            return Err(PredictionError::OneView(moment));
        };
        if one.label != other.label {
            return Err(PredictionError::Label {
                moment,
                first: one.label,
                second: other.label,
            });
        }
        joined.push(Prediction {
            prediction: 0.5 * (one.prediction + other.prediction),
            ..one.clone()
        });
    }
    match others.into_keys().next() {
        Some(moment) => Err(PredictionError::OneView(moment)),
        None => Ok(joined),
    }
}

fn by_moment(rows: &[Prediction]) -> Result<BTreeMap<Moment, &Prediction>, PredictionError> {
    let mut found = BTreeMap::new();
    for row in rows {
        if found.insert(row.moment(), row).is_some() {
            return Err(PredictionError::Twice(row.moment()));
        }
    }
    Ok(found)
}

/// Returns the frame-averaged predictions of each limb's one good (label 1) and two bad (label 3) poses, as in the paper's
/// clinical dataset.
///
/// # Errors
/// [`PredictionError::NoTriple`] for a limb with other poses.
pub fn pose_triples(rows: &[Prediction]) -> Result<Vec<PoseTriple>, PredictionError> {
    let mut limbs: BTreeMap<_, BTreeMap<_, Pose>> = BTreeMap::new();
    for row in rows {
        let limb = LimbId {
            patient: row.patient,
            side: row.side,
        };
        let poses = limbs.entry(limb).or_default();
        let pose = poses.entry(&row.pose).or_insert_with(|| Pose {
            label: row.label,
            frames: vec![],
        });
        pose.frames.push(row.prediction);
    }
    let mut triples = Vec::with_capacity(limbs.len());
    for (limb, poses) in limbs {
        let mean = |pose: &Pose| Ok((pose.label, mean_per_pose(&[&pose.frames])?[0]));
        let poses = poses.values().map(mean);
        let poses = poses.collect::<Result<Vec<_>, MetricError>>()?;
        let count = |label: f64| poses.iter().filter(|pose| pose.0 == label).count();
        triples.push(triple(&poses).ok_or_else(|| PredictionError::NoTriple {
            limb,
            good: count(1.0),
            bad: count(3.0),
        })?);
    }
    Ok(triples)
}

struct Pose {
    label: f64,
    frames: Vec<f64>,
}

/// Reads the rows of a `predictions.csv`.
///
/// # Errors
/// [`ExperimentError::Unreadable`] naming the file.
pub(super) fn read_predictions(path: &Path) -> Result<Vec<Prediction>, ExperimentError> {
    let wrong = |error: csv::Error| ExperimentError::Unreadable {
        path: path.to_owned(),
        message: error.to_string(),
    };
    // Read in full first, because `csv` takes an unreadable header for an empty table.
    let bytes = ppa_core::regular_file::read(path).map_err(|error| wrong(error.into()))?;
    let rows = csv::Reader::from_reader(&bytes[..]).into_deserialize();
    rows.collect::<Result<_, _>>().map_err(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(pose: &str, frame: u32, label: f64, prediction: f64) -> Prediction {
        Prediction {
            patient: 1,
            side: Side::Left,
            pose: pose.to_owned(),
            frame,
            angle_deg: None,
            label,
            prediction,
        }
    }

    #[test]
    fn views_are_joined_by_moment_whatever_their_order() {
        let first = [row("a", 0, 1.0, 1.0), row("b", 0, 3.0, 2.0)];
        let second = [row("b", 0, 3.0, 3.0), row("a", 0, 1.0, 1.5)];
        let joined = join_views(&first, &second).unwrap();
        assert_eq!(joined, [row("a", 0, 1.0, 1.25), row("b", 0, 3.0, 2.5)]);

        let one_view = PredictionError::OneView(row("b", 0, 3.0, 0.0).moment());
        assert_eq!(join_views(&first, &second[1..]), Err(one_view.clone()));
        assert_eq!(join_views(&first[..1], &second), Err(one_view));
        let twice = [first[0].clone(), first[0].clone()];
        assert!(matches!(
            join_views(&twice, &second),
            Err(PredictionError::Twice(_))
        ));
        let other_label = [row("a", 0, 1.5, 1.0), row("b", 0, 3.0, 2.0)];
        assert!(matches!(
            join_views(&first, &other_label),
            Err(PredictionError::Label { .. })
        ));
    }

    #[test]
    fn each_limb_has_one_good_and_two_bad_poses() {
        let rows = [
            row("a", 0, 1.0, 1.0),
            row("a", 1, 1.0, 2.0),
            row("b", 0, 3.0, 2.0),
            row("c", 0, 3.0, 3.0),
        ];
        let triple = PoseTriple {
            good: 1.5,
            bad: [2.0, 3.0],
        };
        assert_eq!(pose_triples(&rows), Ok(vec![triple]));
        let found = pose_triples(&rows[..3]);
        let missing = matches!(
            found,
            Err(PredictionError::NoTriple {
                good: 1,
                bad: 1,
                ..
            })
        );
        assert!(missing, "{found:?}");
    }
}
