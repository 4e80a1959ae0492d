//! The loss of a batch.

use candle_core::{Error, Tensor};

use super::batch_source::Outputs;
use crate::network::CORRECTION_UNIT_DEG;

/// Computes the mean squared error of the quality, plus `correction_weight` times the mean squared error of the correction, in
/// units of 30°, over the samples for which it is known.
pub(super) fn loss(batch: &Outputs, correction_weight: f64) -> Result<Tensor, Error> {
    let outputs = &batch.outputs;
    let column = |values: Vec<f32>| Tensor::new(values, outputs.device())?.unsqueeze(1);
    let labels = column(batch.labels.clone())?;
    if correction_weight == 0.0 {
        return (outputs - labels)?.sqr()?.mean_all();
    }
    let quality = (outputs.narrow(1, 0, 1)? - labels)?.sqr()?.mean_all()?;
    let corrections = &batch.corrections_deg;
    let known: Vec<f32> = corrections.iter().map(|c| c.is_some().into()).collect();
    let count = known.iter().sum::<f32>().max(1.0);
    let units = |degrees: &Option<f32>| degrees.unwrap_or(0.0) / CORRECTION_UNIT_DEG as f32;
    let expected = column(corrections.iter().map(units).collect())?;
    let errors = ((outputs.narrow(1, 1, 1)? - expected)? * column(known)?)?;
    quality + (errors.sqr()?.sum_all()? * (correction_weight / f64::from(count)))?
}

#[cfg(test)]
mod tests {
    use candle_core::Device;

    use super::*;

    #[test]
    fn unknown_corrections_do_not_enter_the_loss() {
        let batch = |outputs: [[f32; 2]; 2], corrections_deg: &[Option<f32>]| Outputs {
            outputs: Tensor::new(&outputs, &Device::Cpu).unwrap(),
            labels: vec![1.0, 3.0],
            corrections_deg: corrections_deg.to_vec(),
        };
        let value = |batch: &Outputs| {
            let loss = loss(batch, 0.5).unwrap();
            loss.to_scalar::<f32>().unwrap()
        };
        // Quality: (0.5² + 0) / 2. Correction: 15° are half a unit, 1.5 was predicted.
        let one = batch([[1.5, 1.5], [3.0, 7.0]], &[Some(15.0), None]);
        assert_eq!(value(&one), 0.125 + 0.5);
        let both = batch([[1.5, 1.5], [3.0, 7.0]], &[Some(15.0), Some(210.0)]);
        assert_eq!(value(&both), 0.125 + 0.25);
        let none = batch([[1.5, 1.5], [3.0, 7.0]], &[None, None]);
        assert_eq!(value(&none), 0.125);
    }
}
