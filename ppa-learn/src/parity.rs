//! Comparison of the network with reference values from another program.

use std::collections::HashMap;
use std::path::Path;

use candle_core::{DType, Device, Tensor};
use serde::Serialize;

use crate::network::{EfficientNetB0, Mode, Options};
use crate::weights::{FirstConvolution, WeightsError};

/// Deviations of the network from reference values.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Parity {
    /// Maximum over the outputs in evaluation (`eval_output_f64`) and in training without dropout and stochastic depth
    /// (`train_output_f64`).
    pub max_abs_output_error: f64,
    /// Mean squared error in training.
    pub loss: f64,
    /// Maximum over the gradients `grad_f64.NAME` of the loss of the length of the difference relative to the reference. References
    /// shorter than 1e-6 of the total gradient are left out: biases before another normalisation, whose gradient is zero in theory.
    pub worst_gradient_rel_l2: f64,
}

/// Runs the network with `weights` on `input` and `target` of the safetensors file `io`, and compares the results.
///
/// # Errors
/// If a file cannot be read, the weights do not fit, or `io` lacks a tensor.
pub fn parity(weights: &Path, io: &Path) -> Result<Parity, WeightsError> {
    let network = EfficientNetB0::new(
        0,
        Options {
            dropout: 0.0,
            stochastic_depth: 0.0,
        },
    )?;
    network.load(weights, FirstConvolution::Fresh)?;
    let unreadable = |source| WeightsError::Read {
        path: io.to_owned(),
        source,
    };
    let bytes = ppa_core::regular_file::read(io).map_err(|error| unreadable(error.into()))?;
    let tensors = candle_core::safetensors::load_buffer(&bytes, &Device::Cpu)
        .map_err(|error| unreadable(error.into()))?;
    let tensor = |name: &str| {
        tensors
            .get(name)
            .ok_or_else(|| unreadable(format!("it has no tensor {name}").into()))
    };

    let evaluated = network.forward(tensor("input")?, Mode::Eval)?;
    let trained = network.forward(tensor("input")?, Mode::Train { step: 0 })?;
    let loss = (&trained - tensor("target")?)?.sqr()?.mean_all()?;
    let gradients = loss.backward()?;
    let [backbone, classifier] = network.variables().map(|variable| {
        gradients
            .get(variable)
            .expect("the loss depends on all variables")
    });
    let ours: HashMap<String, Vec<f64>> = network
        .named([backbone, classifier])?
        .into_iter()
        .map(|named| Ok((named.name, values(&named.tensor)?)))
        .collect::<Result<_, WeightsError>>()?;
    let whole = length(ours.values().flatten());

    let mut worst = 0.0_f64;
    for (name, reference) in &tensors {
        let Some(name) = name.strip_prefix("grad_f64.") else {
            continue;
        };
        let ours = ours
            .get(name)
            .ok_or_else(|| unreadable(format!("{name} is not a parameter").into()))?;
        let reference = values(reference)?;
        if ours.len() != reference.len() {
            return Err(unreadable(
                format!(
                    "the gradient of {name} has {} values, expected {}",
                    reference.len(),
                    ours.len()
                )
                .into(),
            ));
        }
        let difference: Vec<f64> = ours.iter().zip(&reference).map(|(a, b)| a - b).collect();
        if 1e-6 * whole < length(&reference) {
            worst = larger(worst, length(&difference) / length(&reference));
        }
    }
    let error = |ours: &Tensor, name: &str| -> Result<f64, WeightsError> {
        let (ours, reference) = (values(ours)?, values(tensor(name)?)?);
        if ours.len() != reference.len() {
            let (found, expected) = (reference.len(), ours.len());
            return Err(unreadable(
                format!("{name} has {found} values, expected {expected}").into(),
            ));
        }
        let differences = ours.iter().zip(reference).map(|(a, b)| (a - b).abs());
        Ok(differences.fold(0.0, larger))
    };
    Ok(Parity {
        max_abs_output_error: error(&evaluated, "eval_output_f64")?
            .max(error(&trained, "train_output_f64")?),
        loss: loss.to_dtype(DType::F64)?.to_scalar()?,
        worst_gradient_rel_l2: worst,
    })
}

/// Returns the larger of two errors; NaN counts as infinite.
fn larger(a: f64, b: f64) -> f64 {
    if b.is_nan() { f64::INFINITY } else { a.max(b) }
}

fn values(tensor: &Tensor) -> Result<Vec<f64>, WeightsError> {
    Ok(tensor.to_dtype(DType::F64)?.flatten_all()?.to_vec1()?)
}

/// Euclidean length.
fn length<'a>(values: impl IntoIterator<Item = &'a f64>) -> f64 {
    values.into_iter().map(|x| x * x).sum::<f64>().sqrt()
}
