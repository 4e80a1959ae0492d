//! The exponential moving average of the weights.

use candle_core::{CpuStorage, Device, Error, InplaceOp2, Layout, Tensor, Var};

use crate::device::launch::{Launch, contiguous_range};

/// Returns the decay at a step t: at most (1 + t) / (10 + t), as in TensorFlow's `ExponentialMovingAverage`, so that the average lags
/// by at most a tenth of the steps made and soon forgets the initial values.
fn decay(most: f64, step: u64) -> f64 {
    most.min((1 + step) as f64 / (10 + step) as f64)
}

/// Averages of flat variables (Polyak and Juditsky 1992, with weights that decay by step).
#[derive(Debug)]
pub(super) struct Average {
    /// One average for each variable, on its device.
    values: Vec<Tensor>,
}

impl Average {
    /// Starts with the values of variables before the first step.
    pub fn new(variables: &[&Var]) -> Result<Self, Error> {
        let values = variables
            .iter()
            .map(|variable| variable.as_detached_tensor().copy());
        Ok(Self {
            values: values.collect::<Result<_, _>>()?,
        })
    }

    /// Restores the averages after some steps.
    pub fn resume(values: Vec<Vec<f32>>, device: &Device) -> Result<Self, Error> {
        let values = values
            .iter()
            .map(|values| Tensor::new(values.as_slice(), device));
        Ok(Self {
            values: values.collect::<Result<_, _>>()?,
        })
    }

    /// Returns the average of each variable.
    pub fn values(&self) -> Result<Vec<Vec<f32>>, Error> {
        self.values.iter().map(Tensor::to_vec1).collect()
    }

    /// Adds the values of the variables after `steps` steps.
    pub fn add(&mut self, variables: &[&Var], most_decay: f64, steps: u64) -> Result<(), Error> {
        let share = (1.0 - decay(most_decay, steps)) as f32;
        for (average, variable) in self.values.iter_mut().zip(variables) {
            match average.device() {
                Device::Cpu => average.inplace_op2(variable, &Move { share })?,
                _ => *average = moved(average, variable.as_tensor(), share)?,
            }
        }
        Ok(())
    }

    /// Sets variables to the averages.
    pub fn assign(&self, variables: &[&Var]) -> Result<(), Error> {
        for (average, variable) in self.values.iter().zip(variables) {
            variable.set(average)?;
        }
        Ok(())
    }
}

/// Returns an average after a step, on a device.
fn moved(average: &Tensor, values: &Tensor, share: f32) -> Result<Tensor, Error> {
    check_lengths(average.elem_count(), values.elem_count())?;
    let launch = Launch::of_values("move_average", average.shape(), &[]);
    launch.with(&[share]).run(&[average, values])
}

fn check_lengths(averages: usize, values: usize) -> Result<(), Error> {
    match averages == values {
        true => Ok(()),
        false => Err(Error::Msg(format!(
            "found {averages} averages for {values} values"
        ))),
    }
}

/// In-place step of an average: a copy of four million values would cost more than the step itself.
struct Move {
    share: f32,
}

impl InplaceOp2 for Move {
    fn name(&self) -> &'static str {
        "move-average"
    }

    fn cpu_fwd(
        &self,
        average: &mut CpuStorage,
        layout: &Layout,
        values: &CpuStorage,
        values_layout: &Layout,
    ) -> Result<(), Error> {
        let CpuStorage::F32(average) = average else {
            return Err(Error::Msg("only f32 variables can be averaged".to_owned()));
        };
        let average = &mut average[contiguous_range(layout, self.name())?];
        let values = &values.as_slice::<f32>()?[contiguous_range(values_layout, self.name())?];
        check_lengths(average.len(), values.len())?;
        for (average, value) in average.iter_mut().zip(values) {
            *average += self.share * (value - *average);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_average_follows_its_recursion() {
        let variable = Var::new(&[1.0_f32, 0.0], &Device::Cpu).unwrap();
        let mut average = Average::new(&[&variable]).unwrap();
        let mut on_device = average.values[0].copy().unwrap();
        let mut expected = 1.0_f64;
        for step in 1..=200_u32 {
            let value = f64::from(step);
            variable
                .set(&Tensor::new(&[value as f32, 0.0], &Device::Cpu).unwrap())
                .unwrap();
            average.add(&[&variable], 0.9, step.into()).unwrap();
            let decay = f64::min(0.9, (1.0 + value) / (10.0 + value));
            on_device = moved(&on_device, &variable, (1.0 - decay) as f32).unwrap();
            expected = decay * expected + (1.0 - decay) * value;
            let found = f64::from(average.values().unwrap()[0][0]);
            assert!(
                (found - expected).abs() < 1e-3,
                "{step}: {found}, {expected}"
            );
        }
        assert_eq!(
            on_device.to_vec1::<f32>().unwrap(),
            average.values().unwrap()[0]
        );
        assert!(moved(&on_device.narrow(0, 0, 1).unwrap(), &variable, 0.1).is_err());
        // The average follows a line with a lag of decay / (1 - decay) steps.
        assert!((expected - 191.0).abs() < 1e-5, "{expected}");
        average.assign(&[&variable]).unwrap();
        let set = variable.to_vec1::<f32>().unwrap();
        assert_eq!(set, average.values().unwrap()[0]);
        assert_eq!(set[1], 0.0);
    }
}
