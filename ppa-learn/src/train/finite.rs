//! Where the first non-finite numbers appeared.

use std::fmt;

use candle_core::backprop::GradStore;
use candle_core::{Error, Storage, Tensor, Var};

use crate::network::{Entry, Place, QualityNetwork};

/// The layer with the first non-finite numbers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum NonFinite {
    /// A parameter: the previous step was too large.
    Parameter(String),
    /// Running statistics: the first layer with non-finite values in the forward pass.
    Forward(String),
    /// A gradient: the first layer in the backward pass.
    Backward(String),
    /// Inputs, labels or the last layer.
    Output,
}

impl fmt::Display for NonFinite {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Parameter(name) => write!(f, "the parameter {name} is not finite"),
            Self::Forward(name) => write!(f, "the first statistics that are not finite are {name}"),
            Self::Backward(name) => {
                write!(f, "the first gradient that is not finite is that of {name}")
            }
            Self::Output => write!(f, "all layers are finite, but inputs or labels are not"),
        }
    }
}

/// Finds the first non-finite numbers of a network whose loss or gradient is not finite.
pub(super) fn first_non_finite(
    network: &QualityNetwork,
    gradients: &GradStore,
) -> Result<NonFinite, Error> {
    let variables = network.variables();
    let bad_in = |variables: &[&Var], layout: Vec<Place>| -> Result<Option<String>, Error> {
        let flat = variables.iter().map(|v| v.flatten_all()?.to_vec1());
        let flat: Vec<Vec<f32>> = flat.collect::<Result<_, Error>>()?;
        let bad = layout
            .into_iter()
            .find(|p| is_bad(&flat[p.variable], &p.entry));
        Ok(bad.map(|place| place.entry.name))
    };
    if let Some(name) = bad_in(&variables, network.layout())? {
        return Ok(NonFinite::Parameter(name));
    }
    if let Some(name) = bad_in(&network.statistics_variables(), network.statistics_layout())? {
        return Ok(NonFinite::Forward(name));
    }
    let mut last = None;
    for Place { variable, entry } in network.layout() {
        if let Some(gradient) = gradients.get(variables[variable])
            && is_bad(&gradient.flatten_all()?.to_vec1()?, &entry)
        {
            last = Some(entry.name);
        }
    }
    Ok(last.map_or(NonFinite::Output, NonFinite::Backward))
}

fn is_bad(flat: &[f32], entry: &Entry) -> bool {
    flat[entry.range.clone()].iter().any(|x| !x.is_finite())
}

/// Returns whether all values of a tensor are finite.
pub(super) fn is_finite(tensor: &Tensor) -> Result<bool, Error> {
    let (storage, layout) = tensor.storage_and_layout();
    match (&*storage, layout.contiguous_offsets()) {
        // Avoids a copy of four million values.
        (Storage::Cpu(values), Some((start, end))) => {
            let values = &values.as_slice::<f32>()?[start..end];
            Ok(values.iter().all(|x| x.is_finite()))
        }
        // 0 times a finite number is 0; 0 times infinity or NaN is NaN.
        _ => Ok((tensor.detach() * 0.0)?.sum_all()?.to_scalar::<f32>()? == 0.0),
    }
}

#[cfg(test)]
mod tests {
    use candle_core::Device;

    use super::*;

    #[test]
    fn a_single_value_that_is_not_finite_is_found() {
        for (bad, expected) in [(f32::MAX, true), (f32::INFINITY, false), (f32::NAN, false)] {
            let mut values = vec![f32::MAX; 1000];
            values[567] = bad;
            let tensor = Tensor::from_vec(values, (2, 500), &Device::Cpu).unwrap();
            assert_eq!(is_finite(&tensor).unwrap(), expected, "{bad}");
            // As on a device: a transposed matrix has no slice.
            assert_eq!(is_finite(&tensor.t().unwrap()).unwrap(), expected, "{bad}");
        }
    }
}
