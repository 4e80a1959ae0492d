//! Adam with a state that can be saved.

use std::sync::{Mutex, PoisonError};

use candle_core::backprop::GradStore;
use candle_core::{CpuStorage, Device, Error, InplaceOp2, Layout, Var};

const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.999;
const EPSILON: f64 = 1e-8;

/// Adam (Kingma and Ba 2015, arXiv:1412.6980, algorithm 1) without weight decay, with β₁ = 0.9, β₂ = 0.999, ε = 10⁻⁸.
#[derive(Debug, Clone, PartialEq)]
pub struct Adam {
    /// Steps made.
    pub steps: u64,
    /// For each variable the running means of its gradient.
    pub first: Vec<Vec<f32>>,
    /// For each variable the running means of its squared gradient.
    pub second: Vec<Vec<f32>>,
}

impl Adam {
    /// The state before the first step on flat variables of some lengths.
    pub fn new(lengths: impl IntoIterator<Item = usize>) -> Self {
        let zeros: Vec<Vec<f32>> = lengths.into_iter().map(|n| vec![0.0; n]).collect();
        Self {
            steps: 0,
            first: zeros.clone(),
            second: zeros,
        }
    }

    /// Moves flat variables against their gradients, which are on the CPU; what has no gradient stays.
    ///
    /// A variable on another device is moved as a copy here, so that moments and their arithmetic are the same everywhere.
    ///
    /// # Errors
    /// If a variable has another length than its moments.
    pub fn step(
        &mut self,
        variables: &[&Var],
        gradients: &GradStore,
        learning_rate: f64,
    ) -> Result<(), Error> {
        self.steps += 1;
        // Above 2³¹ steps both corrections are 1 anyway.
        let t = i32::try_from(self.steps).unwrap_or(i32::MAX);
        let moments = self.first.iter_mut().zip(&mut self.second);
        for (variable, (first, second)) in variables.iter().zip(moments) {
            let Some(gradient) = gradients.get(variable) else {
                continue;
            };
            let update = Update {
                moments: Mutex::new((first, second)),
                scale: (learning_rate / (1.0 - BETA_1.powi(t))) as f32,
                correction: (1.0 - BETA_2.powi(t)).sqrt() as f32,
            };
            let gradient = gradient.contiguous()?;
            match variable.device() {
                Device::Cpu => variable.inplace_op2(&gradient, &update)?,
                device => {
                    let moved = variable.as_detached_tensor().to_device(&Device::Cpu)?;
                    moved.inplace_op2(&gradient, &update)?;
                    variable.set(&moved.to_device(device)?)?;
                }
            }
        }
        Ok(())
    }
}

/// One step of a variable, in place: copies of four million values would cost as much as the step itself.
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
        let contiguous = |layout: &Layout| {
            let (start, end) = layout
                .contiguous_offsets()
                .ok_or_else(|| Error::RequiresContiguous { op: "adam" }.bt())?;
            Ok::<_, Error>(start..end)
        };
        let CpuStorage::F32(values) = variable else {
            return Err(Error::Msg("Adam moves variables of f32 only".to_owned()));
        };
        let values = &mut values[contiguous(layout)?];
        let gradient = &gradient.as_slice::<f32>()?[contiguous(gradient_layout)?];
        let mut moments = self.moments.lock().unwrap_or_else(PoisonError::into_inner);
        let (first, second) = &mut *moments;
        if values.len() != first.len() || values.len() != gradient.len() {
            return Err(Error::Msg(format!(
                "Adam has moments of {} values, the variable has {}, its gradient {}",
                first.len(),
                values.len(),
                gradient.len()
            )));
        }
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
    use super::*;

    #[test]
    fn the_first_steps_by_hand() {
        // f = x² / 2 from x = 1: the gradient is x. The first step of Adam is the rate, whatever the gradient.
        let x = Var::new(&[1.0_f32], &Device::Cpu).unwrap();
        let mut adam = Adam::new([1]);
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
