//! The exponential moving average of the weights.

use candle_core::{Device, Error, Storage, Tensor, Var};

/// The decay at a step t: at most (1 + t) / (10 + t), as in TensorFlow's `ExponentialMovingAverage`, so that the average lags by a
/// tenth of the steps made at most and soon forgets the first values.
fn decay(most: f64, step: u64) -> f64 {
    most.min((1 + step) as f64 / (10 + step) as f64)
}

/// Averages of flat variables (Polyak and Juditsky 1992, with weights that decay by step).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Average {
    /// One for each variable.
    pub values: Vec<Vec<f32>>,
}

impl Average {
    /// The values of variables before the first step.
    pub fn new(variables: &[&Var]) -> Result<Self, Error> {
        let values = variables.iter().map(|variable| values_of(variable));
        Ok(Self {
            values: values.collect::<Result<_, _>>()?,
        })
    }

    /// Adds the values after a step, `steps` having been made.
    pub fn add(&mut self, variables: &[&Var], most_decay: f64, steps: u64) -> Result<(), Error> {
        let share = (1.0 - decay(most_decay, steps)) as f32;
        let add = |average: &mut [f32], values: &[f32]| {
            for (average, value) in average.iter_mut().zip(values) {
                *average += share * (value - *average);
            }
        };
        for (average, variable) in self.values.iter_mut().zip(variables) {
            let (storage, layout) = variable.storage_and_layout();
            match (&*storage, layout.contiguous_offsets()) {
                // Without a copy of four million values.
                (Storage::Cpu(values), Some((start, end))) => {
                    add(average, &values.as_slice::<f32>()?[start..end]);
                }
                _ => add(average, &values_of(variable)?),
            }
        }
        Ok(())
    }

    /// Sets variables to the averages.
    pub fn assign(&self, variables: &[&Var]) -> Result<(), Error> {
        for (average, variable) in self.values.iter().zip(variables) {
            variable.set(&Tensor::new(average.as_slice(), variable.device())?)?;
        }
        Ok(())
    }
}

fn values_of(variable: &Var) -> Result<Vec<f32>, Error> {
    variable.to_device(&Device::Cpu)?.to_vec1()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_average_follows_its_recursion() {
        let variable = Var::new(&[1.0_f32, 0.0], &Device::Cpu).unwrap();
        let mut average = Average::new(&[&variable]).unwrap();
        let mut expected = 1.0_f64;
        for step in 1..=200_u32 {
            let value = f64::from(step);
            variable
                .set(&Tensor::new(&[value as f32, 0.0], &Device::Cpu).unwrap())
                .unwrap();
            average.add(&[&variable], 0.9, step.into()).unwrap();
            let decay = f64::min(0.9, (1.0 + value) / (10.0 + value));
            expected = decay * expected + (1.0 - decay) * value;
            let found = f64::from(average.values[0][0]);
            assert!(
                (found - expected).abs() < 1e-3,
                "{step}: {found}, {expected}"
            );
        }
        // A line is followed at a distance of decay / (1 - decay) steps.
        assert!((expected - 191.0).abs() < 1e-5, "{expected}");
        average.assign(&[&variable]).unwrap();
        let set = variable.to_vec1::<f32>().unwrap();
        assert_eq!(set, average.values[0]);
        assert_eq!(set[1], 0.0);
    }
}
