//! The confidence of predictions, and the file that holds it.

use std::collections::HashMap;
use std::path::Path;

use candle_core::{Device, Tensor};
use ppa_dataset::write_whole;
use safetensors::SafeTensors;
use serde::{Deserialize, Serialize};

use super::error::FramesError;
use super::networks::Networks;
use crate::confidence::{Appearance, Familiarity, Intervals, Neighbours};

/// Key of what is not a tensor.
const METADATA: &str = "ppa";
/// Names of the tensors that describe training images, of each input: features and blocks.
const NAMES: [[&str; 2]; 2] = [
    ["left.features", "left.blocks"],
    ["right.features", "right.blocks"],
];

/// Intervals of predictions, and what images are like that networks can judge.
#[derive(Debug, Clone, PartialEq)]
pub struct Confidence {
    pub(super) intervals: Intervals,
    /// Of the left and of the right input.
    pub(super) familiarity: [Familiarity; 2],
    /// SHA-256 of each input's network.
    pub(super) networks: [String; 2],
}

/// What a file holds beside tensors.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct State {
    intervals: Intervals,
    /// In the order of tensors.
    limits: [[f32; 2]; 2],
    networks: [String; 2],
}

impl Confidence {
    /// The intervals of predictions.
    pub fn intervals(&self) -> &Intervals {
        &self.intervals
    }

    /// Distance of each input's image from training images, as a share of the limit.
    pub(super) fn relative_distances(&self, images: &[Appearance; 2]) -> [f32; 2] {
        [0, 1].map(|input| self.familiarity[input].relative_distance(&images[input]))
    }

    /// Writes all as safetensors, whole or not at all.
    ///
    /// # Errors
    /// [`FramesError::Confidence`] if the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), FramesError> {
        let wrong = |error: &dyn std::error::Error| wrong(path, error.to_string());
        let state = State {
            intervals: self.intervals.clone(),
            limits: self.respects().map(|both| both.map(|one| one.limit)),
            networks: self.networks.clone(),
        };
        let state = serde_json::to_string(&state).map_err(|error| wrong(&error))?;
        let mut tensors = Vec::new();
        for (name, one) in NAMES.into_iter().flatten().zip(self.respects().concat()) {
            let shape = (one.references.len() / one.size, one.size);
            let tensor = Tensor::from_slice(&one.references, shape, &Device::Cpu);
            tensors.push((name, tensor.map_err(|error| wrong(&error))?));
        }
        let metadata = HashMap::from([(METADATA.to_owned(), state)]);
        let bytes = safetensors::serialize(tensors, Some(metadata));
        let bytes = bytes.map_err(|error| wrong(&error))?;
        write_whole(path, &bytes).map_err(|error| wrong(&error))
    }

    /// Reads what was calibrated with these networks.
    pub(super) fn read(path: &Path, networks: &Networks) -> Result<Self, FramesError> {
        let confidence = Self::parse(path).map_err(|message| wrong(path, message))?;
        match confidence.networks == fingerprints(networks) {
            true => Ok(confidence),
            false => Err(wrong(path, "it was calibrated with other networks".into())),
        }
    }

    /// Of each input, in the order of names.
    fn respects(&self) -> [[&Neighbours; 2]; 2] {
        self.familiarity
            .each_ref()
            .map(|one| [&one.features, &one.blocks])
    }

    fn parse(path: &Path) -> Result<Self, String> {
        let bytes = ppa_core::regular_file::read(path).map_err(|error| error.to_string())?;
        let (_, header) = SafeTensors::read_metadata(&bytes).map_err(|error| error.to_string())?;
        let state = header.metadata().as_ref().and_then(|all| all.get(METADATA));
        let state = state.ok_or("it is no confidence file of ppa calibrate")?;
        let state: State = serde_json::from_str(state).map_err(|error| error.to_string())?;
        if state.intervals.bins.is_empty() {
            return Err("it holds no interval".into());
        }
        let tensors = candle_core::safetensors::load_buffer(&bytes, &Device::Cpu);
        let tensors = tensors.map_err(|error| error.to_string())?;
        let neighbours = |input: usize, respect: usize| {
            let name = NAMES[input][respect];
            let tensor = tensors.get(name).ok_or(format!("it lacks {name}"))?;
            let (count, size) = tensor.dims2().map_err(|error| error.to_string())?;
            let values = tensor.flatten_all().and_then(|all| all.to_vec1());
            let neighbours = Neighbours {
                references: values.map_err(|error| error.to_string())?,
                size,
                limit: state.limits[input][respect],
            };
            let valid = neighbours.are_enough() && neighbours.limit >= 0.0;
            valid.then_some(neighbours).ok_or(format!(
                "{name} are {count} x {size} values, expected at least five rows and a limit"
            ))
        };
        let familiarity = |input| {
            Ok::<_, String>(Familiarity {
                features: neighbours(input, 0)?,
                blocks: neighbours(input, 1)?,
            })
        };
        Ok(Self {
            familiarity: [familiarity(0)?, familiarity(1)?],
            intervals: state.intervals,
            networks: state.networks,
        })
    }
}

/// SHA-256 of the weights of each input's network.
pub(super) fn fingerprints(networks: &Networks) -> [String; 2] {
    networks.of_inputs().map(|trained| trained.sha256.clone())
}

fn wrong(path: &Path, message: String) -> FramesError {
    FramesError::Confidence {
        path: path.to_owned(),
        message,
    }
}
