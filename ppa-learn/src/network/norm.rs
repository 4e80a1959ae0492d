//! Batch normalisation: moments, running statistics, gradient.

use super::architecture::NormPlace;
use crate::kernels::batch_norm::Affine;
use crate::kernels::gradient::Linear;

/// torch's default, added to a variance.
pub const EPSILON: f64 = 1e-5;
/// torch's default: weight of a training batch in the update of the running statistics.
pub const MOMENTUM: f64 = 0.1;

/// A normalisation as it was applied.
#[derive(Debug)]
pub struct Norm {
    pub mean: Vec<f32>,
    pub affine: Affine,
    /// 1 / sigma
    inverse: Vec<f64>,
}

/// Returns a normalisation in evaluation as an affine map.
pub fn running(place: &NormPlace, parameters: &[f32], statistics: &[f32]) -> Affine {
    let moment = |range: &std::ops::Range<usize>| -> Vec<f64> {
        let values = statistics[range.clone()].iter();
        values.map(|&value| value.into()).collect()
    };
    let (mean, variance) = (moment(&place.mean), moment(&place.variance));
    Norm::new(place, parameters, &mean, &variance).affine
}

impl Norm {
    /// Normalises by a batch, for which `sums` holds sum (x - center) and sum (x - center)^2 over `count` values of each channel,
    /// with the running mean as center. Updates the running statistics with `momentum`, using the unbiased variance.
    pub fn batch(
        place: &NormPlace,
        parameters: &[f32],
        statistics: &mut [f32],
        sums: &[f64],
        count: usize,
        momentum: f64,
    ) -> Self {
        let (first, second) = sums.split_at(place.mean.len());
        let count = count as f64;
        let center = &mut statistics[place.mean.clone()];
        let offset: Vec<f64> = first.iter().map(|sum| sum / count).collect();
        let mean: Vec<f64> = center
            .iter()
            .zip(&offset)
            .map(|(center, offset)| f64::from(*center) + offset)
            .collect();
        let variance: Vec<f64> = second
            .iter()
            .zip(&offset)
            .map(|(sum, offset)| (sum / count - offset * offset).max(0.0))
            .collect();
        for (running, offset) in center.iter_mut().zip(&offset) {
            *running = (f64::from(*running) + momentum * offset) as f32;
        }
        for (running, variance) in statistics[place.variance.clone()].iter_mut().zip(&variance) {
            let unbiased = variance * count / (count - 1.0);
            *running = ((1.0 - momentum) * f64::from(*running) + momentum * unbiased) as f32;
        }
        Self::new(place, parameters, &mean, &variance)
    }

    fn new(place: &NormPlace, parameters: &[f32], mean: &[f64], variance: &[f64]) -> Self {
        let inverse: Vec<f64> = variance
            .iter()
            .map(|variance| 1.0 / (variance + EPSILON).sqrt())
            .collect();
        let weight = &parameters[place.weight.clone()];
        let bias = &parameters[place.bias.clone()];
        let scale: Vec<f64> = weight
            .iter()
            .zip(&inverse)
            .map(|(weight, inverse)| f64::from(*weight) * inverse)
            .collect();
        let shift = bias
            .iter()
            .zip(&scale)
            .zip(mean)
            .map(|((bias, scale), mean)| (f64::from(*bias) - scale * mean) as f32);
        Self {
            mean: mean.iter().map(|&mean| mean as f32).collect(),
            affine: Affine {
                shift: shift.collect(),
                scale: scale.iter().map(|&scale| scale as f32).collect(),
            },
            inverse,
        }
    }

    /// Writes the gradients of weight and bias, from sum g and sum g (x - mean) of each channel, and returns that of x.
    pub fn backward(
        &self,
        place: &NormPlace,
        sums: &[f64],
        count: usize,
        gradients: &mut [f32],
    ) -> Linear {
        let channels = self.mean.len();
        let (first, second) = sums.split_at(channels);
        let count = count as f64;
        let mut linear = Linear {
            of_gradient: self.affine.scale.clone(),
            of_input: Vec::with_capacity(channels),
            constant: Vec::with_capacity(channels),
        };
        for c in 0..channels {
            let scale = f64::from(self.affine.scale[c]);
            let of_weight = second[c] * self.inverse[c];
            gradients[place.weight.start + c] = of_weight as f32;
            gradients[place.bias.start + c] = first[c] as f32;
            let of_input = -scale * self.inverse[c] * of_weight / count;
            linear.of_input.push(of_input as f32);
            linear
                .constant
                .push((-scale * first[c] / count - of_input * f64::from(self.mean[c])) as f32);
        }
        linear
    }
}
