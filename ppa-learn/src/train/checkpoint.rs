//! Weights and state of a training run in safetensors files.

use std::collections::HashMap;
use std::path::Path;

use candle_core::{Device, Tensor};
use ppa_dataset::write_whole;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use serde::{Deserialize, Serialize};

use crate::network::QualityNetwork;

use super::adam::Adam;
use super::average::Average;
use super::config::TrainConfig;
use super::data_state::DataState;
use super::error::{TrainError, at};

/// Name of the network in checkpoints.
const ARCHITECTURE: &str = "efficientnet_b0";
/// Names of Adam's moments and of averages, each followed by the number of its variable.
const FIRST: &str = "adam.first";
const SECOND: &str = "adam.second";
const AVERAGE: &str = "average";
/// Metadata key of everything that is not a tensor; a single one, so that equal training runs give equal bytes.
const METADATA: &str = "ppa";

#[derive(Debug, Serialize, Deserialize)]
struct State {
    architecture: String,
    steps: u64,
    config: TrainConfig,
    data: DataState,
}

/// Writes everything that a training run needs to resume.
pub(super) fn save(
    path: &Path,
    network: &QualityNetwork,
    adam: &Adam,
    average: Option<&Average>,
    config: &TrainConfig,
    data: &DataState,
) -> Result<(), TrainError> {
    let state = State {
        architecture: ARCHITECTURE.to_owned(),
        steps: adam.steps,
        config: config.clone(),
        data: data.clone(),
    };
    let state = serde_json::to_string(&state).expect("names and numbers are JSON");
    let named = network.tensors()?.into_iter();
    let mut tensors: Vec<_> = named.map(|named| (named.name, named.tensor)).collect();
    let mut add = |name: &str, i: usize, values: Vec<f32>| {
        let length = values.len();
        let values = Tensor::from_vec(values, length, &Device::Cpu)?;
        tensors.push((format!("{name}.{i}"), values));
        Ok::<_, TrainError>(())
    };
    for (i, [first, second]) in adam.moments()?.into_iter().enumerate() {
        add(FIRST, i, first)?;
        add(SECOND, i, second)?;
    }
    if let Some(average) = average {
        for (i, values) in average.values()?.into_iter().enumerate() {
            add(AVERAGE, i, values)?;
        }
    }
    write(path, tensors, Some([(METADATA.to_owned(), state)].into()))
}

/// Returns the number of steps in a checkpoint.
pub(super) fn steps(path: &Path) -> Result<u64, TrainError> {
    let bytes = std::fs::read(path).map_err(at("read", path))?;
    let wrong = |message: String| TrainError::Checkpoint {
        path: path.to_owned(),
        message,
    };
    Ok(state(&bytes).map_err(wrong)?.steps)
}

/// Reads the part of a checkpoint that is not tensors, or returns why it cannot be read.
fn state(bytes: &[u8]) -> Result<State, String> {
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(|e| e.to_string())?;
    let state = header.metadata().as_ref().and_then(|m| m.get(METADATA));
    let state = state.ok_or("it holds neither steps nor a configuration")?;
    serde_json::from_str(state).map_err(|e| e.to_string())
}

/// Loads a checkpoint's values into a network, its moments into Adam, and its averages, if there are any, into an average.
pub(super) fn load(
    path: &Path,
    network: &QualityNetwork,
    config: &TrainConfig,
    data: &DataState,
) -> Result<(Adam, Option<Average>), TrainError> {
    let wrong = |message: String| TrainError::Checkpoint {
        path: path.to_owned(),
        message,
    };
    let bytes = ppa_core::regular_file::read(path).map_err(at("read", path))?;
    let state = state(&bytes).map_err(wrong)?;
    if state.architecture != ARCHITECTURE {
        let found = state.architecture;
        return Err(wrong(format!("it is for {found}, expected {ARCHITECTURE}")));
    }
    if state.config.of_results() != config.of_results() {
        return Err(wrong(
            "its configuration differs; use another folder".into(),
        ));
    }
    if let Some(difference) = data.differs(&state.data) {
        return Err(wrong(difference + "; use another folder"));
    }
    let tensors = candle_core::safetensors::load_buffer(&bytes, &Device::Cpu)
        .map_err(|e| wrong(e.to_string()))?;
    let variables = network.variables();
    let stored = |name: &str, i: usize| {
        let (name, expected) = (format!("{name}.{i}"), variables[i].elem_count());
        let tensor = tensors
            .get(&name)
            .ok_or_else(|| wrong(format!("{name} is missing")))?;
        if tensor.elem_count() != expected {
            let found = tensor.elem_count();
            return Err(wrong(format!(
                "{name} has {found} values, expected {expected}"
            )));
        }
        Ok(tensor.flatten_all()?.to_vec1()?)
    };
    let all = 0..variables.len();
    let moments = all
        .clone()
        .map(|i| Ok([stored(FIRST, i)?, stored(SECOND, i)?]));
    let moments: Vec<_> = moments.collect::<Result<_, TrainError>>()?;
    let adam = Adam::resume(state.steps, moments, network.device())?;
    let average = match config.weight_average > 0.0 {
        true => {
            let values = all.map(|i| stored(AVERAGE, i));
            let values = values.collect::<Result<_, TrainError>>()?;
            Some(Average::resume(values, network.device())?)
        }
        false => None,
    };
    let assigned = network.assign(&tensors);
    assigned.map_err(|error| error.in_file(path, &[]))?;
    Ok((adam, average))
}

fn write(
    path: &Path,
    tensors: Vec<(String, Tensor)>,
    metadata: Option<HashMap<String, String>>,
) -> Result<(), TrainError> {
    let mut values = Vec::new();
    for (name, tensor) in &tensors {
        let numbers: Vec<f32> = tensor.flatten_all()?.to_vec1()?;
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        values.push((name, tensor.dims().to_vec(), bytes));
    }
    let views = values.iter().map(|(name, shape, bytes)| {
        let view = TensorView::new(Dtype::F32, shape.clone(), bytes);
        (name, view.expect("bytes were counted by the shape"))
    });
    let file = safetensors::serialize(views, metadata).map_err(candle_core::Error::from)?;
    Ok(write_whole(path, &file)?)
}
