//! The confidence of predictions, and its file.

use std::collections::HashMap;
use std::path::Path;

use candle_core::{Device, Tensor};
use ppa_dataset::write_whole;
use safetensors::SafeTensors;
use serde::{Deserialize, Serialize};

use super::error::FramesError;
use super::networks::Networks;
use crate::confidence::{Descriptors, Intervals, Neighbours, OutOfDistributionDetector};
use crate::train::TrainError;

/// Metadata key of everything that is not a tensor.
const METADATA: &str = "ppa";
/// Names of the tensors of each input's descriptors of training images: features and blocks.
const NAMES: [[&str; 2]; 2] = [
    ["left.features", "left.blocks"],
    ["right.features", "right.blocks"],
];

/// Intervals of predictions, and detectors of images unlike the training images.
#[derive(Debug, Clone, PartialEq)]
pub struct Confidence {
    pub(super) intervals: Intervals,
    /// Detectors of the left and the right input.
    pub(super) detectors: [OutOfDistributionDetector; 2],
    /// SHA-256 of the weights of each input's network.
    pub(super) networks: [String; 2],
}

/// Content of a file other than tensors.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct State {
    intervals: Intervals,
    /// Limits in the order of the tensors.
    limits: [[f32; 2]; 2],
    networks: [String; 2],
}

impl Confidence {
    /// Returns the intervals of predictions.
    pub fn intervals(&self) -> &Intervals {
        &self.intervals
    }

    /// Returns the distance of each input's image from the training images, as a share of the limit.
    pub(super) fn relative_distances(&self, images: &[Descriptors; 2]) -> [f32; 2] {
        [0, 1].map(|input| self.detectors[input].relative_distance(&images[input]))
    }

    /// Writes a safetensors file atomically.
    ///
    /// # Errors
    /// [`FramesError::Confidence`] if the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), FramesError> {
        let wrong = |error: &dyn std::error::Error| wrong(path, error.to_string());
        let state = State {
            intervals: self.intervals.clone(),
            limits: self.neighbours().map(|both| both.map(|one| one.limit)),
            networks: self.networks.clone(),
        };
        let state = serde_json::to_string(&state).map_err(|error| wrong(&error))?;
        let mut tensors = Vec::new();
        for (name, one) in NAMES.into_iter().flatten().zip(self.neighbours().concat()) {
            let shape = (one.references.len() / one.size, one.size);
            let tensor = Tensor::from_slice(&one.references, shape, &Device::Cpu);
            tensors.push((name, tensor.map_err(|error| wrong(&error))?));
        }
        let metadata = HashMap::from([(METADATA.to_owned(), state)]);
        let bytes = safetensors::serialize(tensors, Some(metadata));
        let bytes = bytes.map_err(|error| wrong(&error))?;
        write_whole(path, &bytes).map_err(|error| wrong(&error))
    }

    /// Reads a file that was calibrated with these networks.
    pub(super) fn read(path: &Path, networks: &Networks) -> Result<Self, FramesError> {
        let sizes = networks
            .of_inputs()
            .map(|of| Descriptors::sizes(of.config.side));
        let confidence = Self::parse(path, sizes).map_err(|message| wrong(path, message))?;
        match confidence.networks == fingerprints(networks)? {
            true => Ok(confidence),
            false => Err(wrong(path, "it was calibrated with other networks".into())),
        }
    }

    /// Returns the neighbours of each input, in the order of [`NAMES`].
    fn neighbours(&self) -> [[&Neighbours; 2]; 2] {
        self.detectors
            .each_ref()
            .map(|one| [&one.features, &one.blocks])
    }

    /// Reads a file with descriptors of the given sizes for each input.
    fn parse(path: &Path, sizes: [[usize; 2]; 2]) -> Result<Self, String> {
        let bytes = ppa_core::regular_file::read(path).map_err(|error| error.to_string())?;
        let (_, header) = SafeTensors::read_metadata(&bytes).map_err(|error| error.to_string())?;
        let state = header.metadata().as_ref().and_then(|all| all.get(METADATA));
        let state = state.ok_or("it is not a confidence file of ppa calibrate")?;
        let state: State = serde_json::from_str(state).map_err(|error| error.to_string())?;
        if state.intervals.bins.is_empty() {
            return Err("it holds no interval".into());
        }
        let tensors = candle_core::safetensors::load_buffer(&bytes, &Device::Cpu);
        let tensors = tensors.map_err(|error| error.to_string())?;
        let neighbours = |input: usize, descriptor: usize| {
            let name = NAMES[input][descriptor];
            let tensor = tensors.get(name).ok_or(format!("it lacks {name}"))?;
            let (count, size) = tensor.dims2().map_err(|error| error.to_string())?;
            let values = tensor.flatten_all().and_then(|all| all.to_vec1());
            let neighbours = Neighbours {
                references: values.map_err(|error| error.to_string())?,
                size,
                limit: state.limits[input][descriptor],
            };
            let expected = sizes[input][descriptor];
            let valid = size == expected && neighbours.are_enough() && neighbours.limit >= 0.0;
            valid.then_some(neighbours).ok_or(format!(
                "{name} are {count} x {size} values, expected at least 5 x {expected} and a limit"
            ))
        };
        let detector = |input| {
            Ok::<_, String>(OutOfDistributionDetector {
                features: neighbours(input, 0)?,
                blocks: neighbours(input, 1)?,
            })
        };
        Ok(Self {
            detectors: [detector(0)?, detector(1)?],
            intervals: state.intervals,
            networks: state.networks,
        })
    }
}

/// SHA-256 of the weights of each input's network.
pub(super) fn fingerprints(networks: &Networks) -> Result<[String; 2], TrainError> {
    let [left, right] = networks.of_inputs();
    Ok([left.sha256()?, right.sha256()?])
}

fn wrong(path: &Path, message: String) -> FramesError {
    FramesError::Confidence {
        path: path.to_owned(),
        message,
    }
}
