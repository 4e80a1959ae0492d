//! Adam with a state that can be saved.

use candle_core::backprop::GradStore;
use candle_core::{Error, Tensor, Var};

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

    /// Moves flat variables against their gradients; what has no gradient stays.
    ///
    /// # Errors
    /// If a variable has another length than its moments.
    pub fn step(
        &mut self,
        variables: &[&Var],
        gradients: &GradStore,
        rate: f64,
    ) -> Result<(), Error> {
        self.steps += 1;
        // Above 2³¹ steps both corrections are 1 anyway.
        let t = i32::try_from(self.steps).unwrap_or(i32::MAX);
        let scale = (rate / (1.0 - BETA_1.powi(t))) as f32;
        let correction = (1.0 - BETA_2.powi(t)).sqrt() as f32;
        let moments = self.first.iter_mut().zip(&mut self.second);
        for (variable, (first, second)) in variables.iter().zip(moments) {
            let Some(gradient) = gradients.get(variable) else {
                continue;
            };
            let gradient = gradient.flatten_all()?.to_vec1::<f32>()?;
            let mut values = variable.flatten_all()?.to_vec1::<f32>()?;
            if values.len() != first.len() || values.len() != gradient.len() {
                return Err(Error::Msg(format!(
                    "Adam has moments of {} values, the variable has {}, its gradient {}",
                    first.len(),
                    values.len(),
                    gradient.len()
                )));
            }
            let moments = first.iter_mut().zip(second);
            for ((value, g), (m, v)) in values.iter_mut().zip(gradient).zip(moments) {
                *m += (g - *m) * (1.0 - BETA_1) as f32;
                *v = BETA_2 as f32 * *v + (1.0 - BETA_2) as f32 * g * g;
                *value -= scale * *m / (v.sqrt() / correction + EPSILON as f32);
            }
            variable.set(&Tensor::from_vec(
                values,
                variable.shape(),
                variable.device(),
            )?)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use candle_core::Device;

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
