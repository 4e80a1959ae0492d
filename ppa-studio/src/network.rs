//! Predictions of trained networks for the displayed pose.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use ppa_core::{Roi, Side};
use ppa_generate::DepthView;
use ppa_learn::DeviceName;
use ppa_learn::data::Raster;
use ppa_learn::frames::{FramesError, PairPrediction, PairPredictor};
use ppa_learn::train::TrainError;
use serde::Serialize;

use crate::error::StudioError;

/// Placeholder, replaced by the regions of each pose.
const NO_REGIONS: [Roi; 2] = [Roi {
    x_start: 0,
    y_start: 0,
    size: 1,
}; 2];

/// The networks of both cameras, as `ppa predict` takes them.
#[derive(Debug, Clone, Default)]
pub struct Networks {
    /// Folder of the finished training run of the left camera's network, or of one network for both cameras.
    pub left: PathBuf,
    /// Folder of the right camera's network, if it is a separate one.
    pub right: Option<PathBuf>,
    /// File written by `ppa calibrate` for these networks.
    pub confidence: Option<PathBuf>,
}

/// The open networks.
pub(crate) struct Network {
    pub networks: Networks,
    /// Predictor for limbs of one side.
    kept: Mutex<(Side, Arc<PairPredictor>)>,
}

/// Answer of the networks.
#[derive(Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum NetworkAnswer {
    /// Their prediction.
    Prediction(PairPrediction),
    /// Reason why there is no prediction.
    Refused(String),
}

impl Network {
    /// Opens networks.
    ///
    /// # Errors
    /// [`StudioError::Network`] naming the training run that cannot be used.
    pub fn open(networks: Networks) -> Result<Self, StudioError> {
        let side = Side::Right;
        let kept = Mutex::new((side, Arc::new(networks.predictor(NO_REGIONS, Some(side))?)));
        Ok(Self { networks, kept })
    }

    /// Predicts from the depth images of a limb, left camera first.
    pub fn answer(&self, side: Side, views: &[DepthView]) -> NetworkAnswer {
        let [left, right] = views else {
            return NetworkAnswer::Refused(format!("{} cameras, expected two", views.len()));
        };
        let (Some(left_region), Some(right_region)) = (left.region, right.region) else {
            return NetworkAnswer::Refused("a camera does not see the joint".to_owned());
        };
        let predicted = self.of_side(side).and_then(|predictor| {
            let predictor = predictor.with_regions([left_region, right_region]);
            predictor.predict_images([&raster(left)?, &raster(right)?])
        });
        match predicted {
            Ok(prediction) => NetworkAnswer::Prediction(prediction),
            Err(error) => NetworkAnswer::Refused(error.to_string()),
        }
    }

    fn of_side(&self, side: Side) -> Result<Arc<PairPredictor>, FramesError> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.0 != side {
            *kept = (
                side,
                Arc::new(self.networks.predictor(NO_REGIONS, Some(side))?),
            );
        }
        Ok(kept.1.clone())
    }
}

impl Networks {
    /// Opens the networks for frames that show the joint in these regions of the left and the right camera.
    pub(crate) fn predictor(
        &self,
        regions: [Roi; 2],
        side: Option<Side>,
    ) -> Result<PairPredictor, FramesError> {
        let (left, right) = (&self.left, self.right.as_deref());
        let predictor = PairPredictor::new(left, right, regions, side, DeviceName::Cpu)?;
        match &self.confidence {
            Some(file) => predictor.with_confidence(file),
            None => Ok(predictor),
        }
    }
}

/// Returns a depth image in whole millimetres, as in the files used for training.
fn raster(view: &DepthView) -> Result<Raster<u16>, FramesError> {
    let rounded = view.image.to_u16();
    let (width, height) = (rounded.width as usize, rounded.height as usize);
    Ok(Raster::new(width, height, rounded.z_mm).map_err(TrainError::from)?)
}
