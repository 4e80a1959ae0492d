//! Squeeze-and-excitation (Hu et al. 2018, arXiv:1709.01507), with its gradients.

use candle_core::{Result, Tensor};
use candle_nn::ops::sigmoid;

use super::super::architecture::{LinearPlace, SqueezePlace};
use super::parameters::{Gradients, Parameters};
use super::reduce;
use crate::device::launch::Launch;

/// Gates of channels, and the values that their gradient needs; all [images, channels] or [images, squeezed].
pub struct Gate {
    pooled: Tensor,
    hidden: Tensor,
    active: Tensor,
    pub gates: Tensor,
}

impl Gate {
    /// Computes the gates from the mean of each channel over each image.
    pub fn new(place: &SqueezePlace, parameters: Parameters, pooled: Tensor) -> Result<Self> {
        let hidden = linear(&place.squeeze, parameters, &pooled)?;
        let active = hidden.silu()?;
        let gates = sigmoid(&linear(&place.expand, parameters, &active)?)?;
        Ok(Self {
            pooled,
            hidden,
            active,
            gates,
        })
    }

    /// Computes the gradient of the means from that of the gates.
    pub fn backward(
        &self,
        place: &SqueezePlace,
        parameters: Parameters,
        of_gates: &Tensor,
        gradients: &mut Gradients,
    ) -> Result<Tensor> {
        let launch = Launch::of_values("sigmoid_of_input", of_gates.shape(), &[]);
        let of_output = launch.run(&[&self.gates, of_gates])?;
        let of_active = of_linear(
            &place.expand,
            parameters,
            &self.active,
            &of_output,
            gradients,
        )?;
        let launch = Launch::of_values("silu_of_input", of_active.shape(), &[]);
        let of_hidden = launch.run(&[&self.hidden, &of_active])?;
        of_linear(
            &place.squeeze,
            parameters,
            &self.pooled,
            &of_hidden,
            gradients,
        )
    }
}

fn linear(place: &LinearPlace, parameters: Parameters, x: &Tensor) -> Result<Tensor> {
    let weight = parameters.rows(&place.weight, place.bias.len())?;
    let product = x.matmul(&weight.t()?)?;
    product.broadcast_add(&parameters.values(&place.bias)?)
}

/// Computes the gradient of x from that of the output.
fn of_linear(
    place: &LinearPlace,
    parameters: Parameters,
    x: &Tensor,
    of_output: &Tensor,
    gradients: &mut Gradients,
) -> Result<Tensor> {
    let weight = parameters.rows(&place.weight, place.bias.len())?;
    gradients.add(&place.weight, of_output.t()?.matmul(x)?)?;
    gradients.add(&place.bias, reduce::sum(of_output.clone())?)?;
    of_output.matmul(&weight)
}
