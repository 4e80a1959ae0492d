//! Values of a whole network by torchvision's names, from files and to files.

mod file;
mod metadata;
mod names;
mod onnx;
mod onnx_messages;
mod onnx_network;
#[cfg(test)]
mod onnx_tests;
mod quality;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

pub use metadata::WeightsMetadata;

use candle_core::{DType, Tensor, Var};
use serde::{Deserialize, Serialize};

use crate::network::{EfficientNetB0, Entry, NetworkError};

/// What becomes of a first convolution that was trained on several channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FirstConvolution {
    /// Discarded: the network keeps its own, as the paper's authors do.
    #[default]
    Fresh,
    /// The sum over the channels: what an image that is the same in all channels would have given.
    Sum,
    /// The mean over the channels.
    Mean,
}

/// What was not taken from a weight file as it stood.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Loaded {
    /// How a first convolution of several channels became one of one channel.
    pub first_convolution: Option<FirstConvolution>,
    /// The file's classifier has another number of outputs; the network kept its own.
    pub fresh_classifier: bool,
    /// One clause for each tensor that is missing or has another shape, and that the network kept as it was.
    pub kept: Vec<String>,
    /// Names in the file that the network does not have, without PyTorch's counters of batches.
    pub unused: Vec<String>,
}

/// Why a network could not take the values that it was given, or not write its own.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WeightsError {
    /// Tensors that are not there, have another shape or hold what is not a weight.
    #[error("{} not fit EfficientNet-B0 with one channel: {}{}", place(.path), .misfits.join("; "), beyond(.unused))]
    Misfit {
        /// The file, if the values came from one.
        path: Option<PathBuf>,
        /// One clause for each tensor.
        misfits: Vec<String>,
        /// Names in the file that the network does not have.
        unused: Vec<String>,
    },
    /// A file that cannot be read.
    #[error("cannot read weights from {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A file that cannot be written.
    #[error(transparent)]
    Write(#[from] ppa_dataset::FileError),
    /// An error of the network.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// An error of candle.
    #[error("cannot convert the weights to f32")]
    Candle(#[from] candle_core::Error),
}

fn place(path: &Option<PathBuf>) -> String {
    path.as_ref().map_or_else(
        || "the weights do".into(),
        |path| format!("the weights of {} do", path.display()),
    )
}

fn beyond(unused: &[String]) -> String {
    match unused {
        [] => String::new(),
        names => format!("; not in the network: {}", names.join(", ")),
    }
}

impl WeightsError {
    /// Names the file, and what it holds beyond the network.
    pub(crate) fn in_file(self, file: &Path, unused: &[String]) -> Self {
        match self {
            Self::Misfit { misfits, .. } => Self::Misfit {
                path: Some(file.to_owned()),
                misfits,
                unused: unused.to_vec(),
            },
            other => other,
        }
    }
}

impl EfficientNetB0 {
    /// Takes the values of every parameter and running statistic, by torchvision's names; other names are not looked at.
    ///
    /// # Errors
    /// If any is missing, has another shape or holds what is not a weight, each named; the network is then as before.
    pub fn assign(&self, tensors: &HashMap<String, Tensor>) -> Result<(), WeightsError> {
        let statistics = self.statistics_layout().map(|entry| (2, entry));
        let [backbone, classifier] = self.variables();
        let variables = [backbone, classifier, self.statistics_variable()];
        assign(&variables, self.layout().chain(statistics), tensors)
    }
}

/// Fills flat variables with tensors, by the names of entries that lie one after the other in each.
fn assign<'a>(
    variables: &[&Var],
    entries: impl IntoIterator<Item = (usize, &'a Entry)>,
    tensors: &HashMap<String, Tensor>,
) -> Result<(), WeightsError> {
    let mut flat = vec![Vec::new(); variables.len()];
    let mut misfits = Vec::new();
    for (variable, entry) in entries {
        match fitting(tensors, entry) {
            Ok(values) => flat[variable].extend(values),
            Err(misfit) => misfits.push(misfit),
        }
    }
    if !misfits.is_empty() {
        return Err(WeightsError::Misfit {
            path: None,
            misfits,
            unused: Vec::new(),
        });
    }
    for (variable, values) in variables.iter().zip(flat) {
        variable.set(&Tensor::new(values, variable.device())?)?;
    }
    Ok(())
}

fn other_shape(name: &str, found: &[usize], expected: &[usize]) -> String {
    format!("{name} has the shape {found:?}, expected {expected:?}")
}

fn missing(name: &str) -> String {
    format!("{name} is missing")
}

/// The values of an entry, or a clause on why there are none.
fn fitting(tensors: &HashMap<String, Tensor>, entry: &Entry) -> Result<Vec<f32>, String> {
    let name = &entry.name;
    let tensor = tensors.get(name).ok_or_else(|| missing(name))?;
    if tensor.dims() != entry.shape {
        return Err(other_shape(name, tensor.dims(), &entry.shape));
    }
    let values = tensor
        .to_dtype(DType::F32)
        .and_then(|tensor| tensor.flatten_all()?.to_vec1::<f32>());
    let values = values.map_err(|error| format!("{name} cannot be read as numbers ({error})"))?;
    let least = if name.ends_with("running_var") {
        0.0
    } else {
        f32::MIN
    };
    match values
        .iter()
        .find(|value| !(least..=f32::MAX).contains(*value))
    {
        Some(value) => Err(format!("{name} holds {value}")),
        None => Ok(values),
    }
}
