//! Parameters of layers in the flat variable, and their gradients.

use std::ops::Range;

use candle_core::{Result, Tensor};

use super::super::architecture::NormPlace;

/// The flat parameters of the backbone.
#[derive(Clone, Copy)]
pub struct Parameters<'a>(pub &'a Tensor);

impl Parameters<'_> {
    pub fn values(&self, range: &Range<usize>) -> Result<Tensor> {
        self.0.narrow(0, range.start, range.len())
    }

    /// Returns a range as a matrix with `rows` rows.
    pub fn rows(&self, range: &Range<usize>, rows: usize) -> Result<Tensor> {
        self.values(range)?.reshape((rows, ()))
    }

    /// Returns [weight and bias, channels]; the bias directly follows the weight.
    pub fn affine(&self, place: &NormPlace) -> Result<Tensor> {
        self.rows(&(place.weight.start..place.bias.end), 2)
    }
}

/// Gradients of parts of the flat parameters, in any order.
#[derive(Default)]
pub struct Gradients(Vec<(Range<usize>, Tensor)>);

impl Gradients {
    pub fn add(&mut self, range: &Range<usize>, gradient: Tensor) -> Result<()> {
        self.0.push((range.clone(), gradient.flatten_all()?));
        Ok(())
    }

    pub fn add_affine(&mut self, place: &NormPlace, gradient: Tensor) -> Result<()> {
        self.add(&(place.weight.start..place.bias.end), gradient)
    }

    /// Returns the gradient of all parameters, each of which must have one.
    pub fn flat(mut self) -> Result<Tensor> {
        self.0.sort_by_key(|(range, _)| range.start);
        let tensors: Vec<Tensor> = self.0.into_iter().map(|(_, tensor)| tensor).collect();
        Tensor::cat(&tensors, 0)
    }
}
