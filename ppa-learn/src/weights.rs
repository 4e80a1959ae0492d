//! Reading and writing of all values of a network by torchvision's names.

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

/// Conversion of a first convolution that was trained on several channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FirstConvolution {
    /// Discarded: the network keeps its own, as the paper's authors do.
    #[default]
    Fresh,
    /// The sum over the channels: equivalent to an image that is the same in all channels.
    Sum,
    /// The mean over the channels.
    Mean,
}

/// Record of what was not taken unchanged from a weight file.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Loaded {
    /// How a first convolution of several channels was converted to one channel.
    pub first_convolution: Option<FirstConvolution>,
    /// Whether the file's classifier has a different number of outputs, so that the network kept its own.
    pub fresh_classifier: bool,
    /// One clause for each tensor that is missing or has another shape, so that the network kept its own.
    pub kept: Vec<String>,
    /// Names in the file that the network does not have, except PyTorch's batch counters.
    pub unused: Vec<String>,
}

/// Error in reading or writing the values of a network.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WeightsError {
    /// Tensors that are missing, have another shape or contain invalid weights.
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
        /// The cause.
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
    /// Adds the file and the names in it that the network does not have.
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
    /// Sets every parameter and running statistic by torchvision's names; other names are ignored.
    ///
    /// # Errors
    /// If tensors are missing, have another shape or contain invalid weights, naming each; the network is then unchanged.
    pub fn assign(&self, tensors: &HashMap<String, Tensor>) -> Result<(), WeightsError> {
        let statistics = self.statistics_layout().map(|entry| (2, entry));
        let [backbone, classifier] = self.variables();
        let variables = [backbone, classifier, self.statistics_variable()];
        assign(&variables, self.layout().chain(statistics), tensors)
    }
}

/// Fills flat variables with tensors, by the names of the consecutive entries of each variable.
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

/// Returns the values of an entry, or a clause that says why there are none.
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
