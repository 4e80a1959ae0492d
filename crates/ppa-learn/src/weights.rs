//! Values of a whole network by torchvision's names.

use std::collections::HashMap;

use candle_core::{DType, Tensor};

use crate::network::{EfficientNetB0, Entry, NetworkError};

/// Why a network could not take the values that it was given.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WeightsError {
    /// Tensors that are not there or have another shape.
    #[error("weights do not fit EfficientNet-B0 with one channel and one output: {}", .0.join("; "))]
    Misfit(Vec<String>),
    /// An error of the network.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// An error of candle.
    #[error("cannot read the weights")]
    Candle(#[from] candle_core::Error),
}

impl EfficientNetB0 {
    /// Takes the values of every parameter and running statistic, by torchvision's names; other names are not looked at.
    ///
    /// # Errors
    /// If any is missing or has another shape, each named; the network is then as before.
    pub fn assign(&self, tensors: &HashMap<String, Tensor>) -> Result<(), WeightsError> {
        let mut flat = [Vec::new(), Vec::new(), Vec::new()];
        let mut misfits = Vec::new();
        let statistics = self.statistics_layout().map(|entry| (2, entry));
        for (variable, entry) in self.layout().chain(statistics) {
            match fitting(tensors, entry) {
                Ok(tensor) => {
                    let values = tensor
                        .to_dtype(DType::F32)?
                        .flatten_all()?
                        .to_vec1::<f32>()?;
                    flat[variable].extend(values);
                }
                Err(misfit) => misfits.push(misfit),
            }
        }
        if !misfits.is_empty() {
            return Err(WeightsError::Misfit(misfits));
        }
        let [backbone, classifier] = self.variables();
        for (variable, values) in [backbone, classifier, self.statistics_variable()]
            .into_iter()
            .zip(flat)
        {
            variable.set(&Tensor::new(values, variable.device())?)?;
        }
        Ok(())
    }
}

/// The tensor of an entry, or a sentence on why there is none.
fn fitting<'a>(tensors: &'a HashMap<String, Tensor>, entry: &Entry) -> Result<&'a Tensor, String> {
    match tensors.get(&entry.name) {
        None => Err(format!("{} is missing", entry.name)),
        Some(tensor) if tensor.dims() != entry.shape => Err(format!(
            "{} has the shape {:?}, expected {:?}",
            entry.name,
            tensor.dims(),
            entry.shape
        )),
        Some(tensor) => Ok(tensor),
    }
}
