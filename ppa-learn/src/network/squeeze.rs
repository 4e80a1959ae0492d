//! Squeeze-and-excitation (Hu et al. 2018, arXiv:1709.01507): a gate for each channel from the channels' means.

use super::architecture::{LinearPlace, SqueezePlace};
use crate::kernels::matrix::{Matrix, Store, multiply};

/// Values of a forward pass that the gradient needs; all [images, channels] or [images, squeezed].
#[derive(Debug)]
pub struct Squeeze {
    pub pooled: Vec<f32>,
    hidden: Vec<f32>,
    pub gate: Vec<f32>,
}

fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + (-x).exp())
}

/// rows * weight' + bias, for a weight [out, in].
fn linear(rows: &[f32], place: &LinearPlace, parameters: &[f32]) -> Vec<f32> {
    let weight = &parameters[place.weight.clone()];
    let bias = &parameters[place.bias.clone()];
    let columns = weight.len() / bias.len();
    let images = rows.len() / columns;
    let mut out = bias.repeat(images);
    multiply(
        &mut out,
        Matrix::new(rows, columns),
        Matrix::new(weight, columns).transposed(),
        Store::Add,
    );
    out
}

impl Squeeze {
    /// Computes the gates from the means of the activated channels [images, channels].
    pub fn forward(place: &SqueezePlace, parameters: &[f32], pooled: Vec<f32>) -> Self {
        let hidden = linear(&pooled, &place.squeeze, parameters);
        let active: Vec<f32> = hidden.iter().map(|&x| x * sigmoid(x)).collect();
        let mut gate = linear(&active, &place.expand, parameters);
        gate.iter_mut().for_each(|x| *x = sigmoid(*x));
        Self {
            pooled,
            hidden,
            gate,
        }
    }

    /// Returns the gradient of the means, given that of the gates, and writes those of the parameters.
    pub fn backward(
        &self,
        place: &SqueezePlace,
        parameters: &[f32],
        of_gate: &[f32],
        gradients: &mut [f32],
    ) -> Vec<f32> {
        let (channels, squeezed) = (place.expand.bias.len(), place.squeeze.bias.len());
        let of_expanded: Vec<f32> = of_gate
            .iter()
            .zip(&self.gate)
            .map(|(g, s)| g * s * (1.0 - s))
            .collect();
        let active: Vec<f32> = self.hidden.iter().map(|&x| x * sigmoid(x)).collect();
        layer_gradients(&of_expanded, &active, &place.expand, gradients);

        let mut of_hidden = vec![0.0; self.hidden.len()];
        let weight = Matrix::new(&parameters[place.expand.weight.clone()], squeezed);
        multiply(
            &mut of_hidden,
            Matrix::new(&of_expanded, channels),
            weight,
            Store::Replace,
        );
        for (g, &x) in of_hidden.iter_mut().zip(&self.hidden) {
            let s = sigmoid(x);
            *g *= s * (1.0 + x * (1.0 - s));
        }
        layer_gradients(&of_hidden, &self.pooled, &place.squeeze, gradients);

        let mut of_pooled = vec![0.0; self.pooled.len()];
        let weight = Matrix::new(&parameters[place.squeeze.weight.clone()], channels);
        multiply(
            &mut of_pooled,
            Matrix::new(&of_hidden, squeezed),
            weight,
            Store::Replace,
        );
        of_pooled
    }
}

/// Writes the gradients of weight [out, in] and bias of a layer, given those of its output [images, out].
fn layer_gradients(of_out: &[f32], input: &[f32], place: &LinearPlace, gradients: &mut [f32]) {
    let LinearPlace { weight, bias } = place;
    let (out, columns) = (bias.len(), weight.len() / bias.len());
    let left = Matrix::new(of_out, out).transposed();
    multiply(
        &mut gradients[weight.clone()],
        left,
        Matrix::new(input, columns),
        Store::Replace,
    );
    let of_bias = &mut gradients[bias.clone()];
    of_bias.fill(0.0);
    for row in of_out.chunks_exact(out) {
        for (sum, g) in of_bias.iter_mut().zip(row) {
            *sum += g;
        }
    }
}
