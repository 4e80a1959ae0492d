//! Adam with a state that can be saved.

use std::sync::{Mutex, PoisonError};

use candle_core::backprop::GradStore;
use candle_core::{CpuStorage, Device, Error, InplaceOp2, Layout, Tensor, Var};

use crate::device::launch::{Launch, contiguous_range};

const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.999;
const EPSILON: f64 = 1e-8;

/// Adam (Kingma and Ba 2015, arXiv:1412.6980, algorithm 1) without weight decay, with β₁ = 0.9, β₂ = 0.999, ε = 10⁻⁸.
#[derive(Debug, Clone)]
pub struct Adam {
    /// Number of steps made.
    pub steps: u64,
    /// Moments of each variable.
    moments: Vec<Moments>,
}

/// Running means of a variable's gradient and of its square, on the variable's device.
#[derive(Debug, Clone)]
enum Moments {
    Cpu {
        first: Vec<f32>,
        second: Vec<f32>,
    },
    /// [first and second, values]
    Device(Tensor),
}

impl Adam {
    /// Makes the state before the first step on flat variables.
    ///
    /// # Errors
    /// If a device runs out of memory.
    pub fn new(variables: &[&Var]) -> Result<Self, Error> {
        let zeros = variables.iter().map(|variable| {
            let zeros = vec![0.0; variable.elem_count()];
            Moments::new(zeros.clone(), zeros, variable.device())
        });
        Ok(Self {
            steps: 0,
            moments: zeros.collect::<Result<_, _>>()?,
        })
    }

    /// Restores the state after some steps, with the two moments of each variable.
    pub(super) fn resume(
        steps: u64,
        moments: impl IntoIterator<Item = [Vec<f32>; 2]>,
        device: &Device,
    ) -> Result<Self, Error> {
        let moments = moments.into_iter();
        let moments = moments.map(|[first, second]| Moments::new(first, second, device));
        Ok(Self {
            steps,
            moments: moments.collect::<Result<_, _>>()?,
        })
    }

    /// Returns the two moments of each variable.
    pub(super) fn moments(&self) -> Result<Vec<[Vec<f32>; 2]>, Error> {
        let values = |moments: &Moments| match moments {
            Moments::Cpu { first, second } => Ok([first.clone(), second.clone()]),
            Moments::Device(both) => Ok([both.get(0)?.to_vec1()?, both.get(1)?.to_vec1()?]),
        };
        self.moments.iter().map(values).collect()
    }

    /// Updates flat variables by their gradients; variables without a gradient stay unchanged.
    ///
    /// # Errors
    /// If the lengths of a variable and its moments differ.
    pub fn step(
        &mut self,
        variables: &[&Var],
        gradients: &GradStore,
        learning_rate: f64,
    ) -> Result<(), Error> {
        self.steps += 1;
        // Above 2³¹ steps both corrections are 1 anyway.
        let t = i32::try_from(self.steps).unwrap_or(i32::MAX);
        let scale = (learning_rate / (1.0 - BETA_1.powi(t))) as f32;
        let correction = (1.0 - BETA_2.powi(t)).sqrt() as f32;
        for (variable, moments) in variables.iter().zip(&mut self.moments) {
            let Some(gradient) = gradients.get(variable) else {
                continue;
            };
            let gradient = gradient.contiguous()?;
            match moments {
                Moments::Cpu { first, second } => {
                    let update = Update {
                        moments: Mutex::new((first, second)),
                        scale,
                        correction,
                    };
                    variable.inplace_op2(&gradient, &update)?;
                }
                Moments::Device(moments) => {
                    check_lengths(
                        moments.dim(1)?,
                        variable.elem_count(),
                        gradient.elem_count(),
                    )?;
                    let launch =
                        Launch::new("adam_moments", moments.shape(), gradient.elem_count(), &[]);
                    let shares = [1.0 - BETA_1, 1.0 - BETA_2].map(|share| share as f32);
                    *moments = launch.with(&shares).run(&[moments, &gradient])?;
                    let launch = Launch::of_values("adam_step", variable.shape(), &[]);
                    let launch = launch.with(&[scale, correction, EPSILON as f32]);
                    let moved = launch.run(&[variable.as_tensor(), moments])?;
                    variable.set(&moved)?;
                }
            }
        }
        Ok(())
    }
}

impl Moments {
    fn new(first: Vec<f32>, second: Vec<f32>, device: &Device) -> Result<Self, Error> {
        if device.is_cpu() {
            return Ok(Self::Cpu { first, second });
        }
        let shape = (2, first.len());
        Tensor::from_vec([first, second].concat(), shape, device).map(Self::Device)
    }
}

fn check_lengths(moments: usize, variable: usize, gradient: usize) -> Result<(), Error> {
    if variable == moments && gradient == moments {
        return Ok(());
    }
    Err(Error::Msg(format!(
        "Adam has moments of {moments} values, but the variable has {variable} and its gradient {gradient}"
    )))
}

/// In-place step of a variable: copies of four million values would cost as much as the step itself.
struct Update<'a> {
    /// In a mutex because an operation of candle is shared.
    moments: Mutex<(&'a mut [f32], &'a mut [f32])>,
    scale: f32,
    correction: f32,
}

impl InplaceOp2 for Update<'_> {
    fn name(&self) -> &'static str {
        "adam"
    }

    fn cpu_fwd(
        &self,
        variable: &mut CpuStorage,
        layout: &Layout,
        gradient: &CpuStorage,
        gradient_layout: &Layout,
    ) -> Result<(), Error> {
        let CpuStorage::F32(values) = variable else {
            return Err(Error::Msg("Adam updates f32 variables only".to_owned()));
        };
        let values = &mut values[contiguous_range(layout, self.name())?];
        let gradient =
            &gradient.as_slice::<f32>()?[contiguous_range(gradient_layout, self.name())?];
        let mut moments = self.moments.lock().unwrap_or_else(PoisonError::into_inner);
        let (first, second) = &mut *moments;
        check_lengths(first.len(), values.len(), gradient.len())?;
        let moments = first.iter_mut().zip(second.iter_mut());
        for ((value, g), (m, v)) in values.iter_mut().zip(gradient).zip(moments) {
            *m += (g - *m) * (1.0 - BETA_1) as f32;
            *v = BETA_2 as f32 * *v + (1.0 - BETA_2) as f32 * g * g;
            *value -= self.scale * *m / (v.sqrt() / self.correction + EPSILON as f32);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use candle_core::DType;

    use super::*;

    #[test]
    fn the_first_steps_by_hand() {
        let on_cpu = Moments::new(vec![0.0], vec![0.0], &Device::Cpu).unwrap();
        let zeros = Tensor::zeros((2, 1), DType::F32, &Device::Cpu).unwrap();
        steps_are_those_by_hand(on_cpu);
        steps_are_those_by_hand(Moments::Device(zeros));
    }

    fn steps_are_those_by_hand(moments: Moments) {
        // f = x² / 2 from x = 1: the gradient is x. The first step of Adam is the rate, whatever the gradient.
        let x = Var::new(&[1.0_f32], &Device::Cpu).unwrap();
        let mut adam = Adam {
            steps: 0,
            moments: vec![moments],
        };
        let (mut m, mut v, mut expected) = (0.0_f64, 0.0_f64, 1.0_f64);
        for t in 1..=50 {
            let loss = (x.sqr().unwrap() / 2.0).unwrap().sum_all().unwrap();
            adam.step(&[&x], &loss.backward().unwrap(), 0.01).unwrap();
            m = 0.9 * m + 0.1 * expected;
            v = 0.999 * v + 0.001 * expected * expected;
            let (m, v) = (m / (1.0 - 0.9_f64.powi(t)), v / (1.0 - 0.999_f64.powi(t)));
            expected -= 0.01 * m / (v.sqrt() + 1e-8);
            let found = f64::from(x.to_vec1::<f32>().unwrap()[0]);
            assert!(
                (found - expected).abs() < 1e-5,
                "step {t}: {found}, {expected}"
            );
            if t == 1 {
                assert!((found - 0.99).abs() < 1e-6);
            }
        }
    }
}
