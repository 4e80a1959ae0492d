//! Fusion of the images of both cameras into one prediction, which the authors' repository offers in addition to separate networks
//! (github.com/INB-KI-SIGS/patient-pose-assessment, commit 3bbf3e9).

use candle_core::{Device, Tensor, Var};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, Uniform};
use serde::{Deserialize, Serialize};

use super::architecture::Entry;
use super::initialise::gains;
use super::{NetworkError, on_device, variable};
use crate::random::{Purpose, stream};

/// Number of outputs of each camera's network in late fusion.
pub const LATE_OUTPUTS: usize = 512;
/// Number of values of the hidden layer.
const HIDDEN: usize = 256;

/// Stage at which both cameras are joined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FusionKind {
    /// Each camera's network predicts a quality; the result is their mean.
    Score,
    /// Each camera's network gives 512 values, from which two more layers compute the prediction.
    Late,
}

/// Fusion of both cameras' images of one moment.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fusion {
    /// Stage at which both cameras are joined.
    pub kind: FusionKind,
    /// One network for both cameras instead of one for each; training normalises by the images of both.
    pub shared_weights: bool,
    /// Probability that a step drops a camera; never both.
    pub branch_dropout: f32,
    /// Probability that late fusion drops a value before its last layer.
    pub late_dropout: f32,
}

impl Default for Fusion {
    /// Score fusion of separate networks with the authors' probabilities: 0.2 and 0.3.
    fn default() -> Self {
        Self {
            kind: FusionKind::Score,
            shared_weights: false,
            branch_dropout: 0.2,
            late_dropout: 0.3,
        }
    }
}

/// Returns the factors of both cameras in a training step: 0 for a dropped camera, such that the mean factor is 1.
pub fn branch_gains(random: &mut impl Rng, drop: f32) -> [f64; 2] {
    let mut kept = [(); 2].map(|()| drop <= random.random::<f32>());
    if kept == [false; 2] {
        kept[random.random_range(0..2)] = true;
    }
    match kept {
        [true, true] => [1.0, 1.0],
        _ => kept.map(|kept| if kept { 2.0 } else { 0.0 }),
    }
}

/// The layers after both cameras' networks: SiLU, 1024 to 256 values, SiLU, dropout, 256 to the network's outputs.
#[derive(Debug, Clone)]
pub struct LateFusion {
    variable: Var,
    entries: Vec<Entry>,
    dropout: f32,
}

impl LateFusion {
    /// Makes layers with torch's initial values: weights and biases uniform in ±1 / sqrt(number of inputs).
    pub fn new(seed: u64, dropout: f32, outputs: usize) -> Result<Self, NetworkError> {
        let layers = [
            ("fc.0", HIDDEN, 2 * LATE_OUTPUTS),
            ("fc.3", outputs, HIDDEN),
        ];
        let (mut entries, mut values) = (Vec::new(), Vec::new());
        for (name, out, columns) in layers {
            let bound = 1.0 / (columns as f32).sqrt();
            let uniform = Uniform::new(-bound, bound).expect("a bound is positive");
            for (part, shape) in [("weight", vec![out, columns]), ("bias", vec![out])] {
                let mut random = stream(seed, Purpose::FusionWeights, entries.len() as u64);
                let start = values.len();
                let count = shape.iter().product();
                values.extend(uniform.sample_iter(&mut random).take(count));
                entries.push(Entry {
                    name: format!("{name}.{part}"),
                    shape,
                    range: start..values.len(),
                });
            }
        }
        Ok(Self {
            variable: variable(values)?,
            entries,
            dropout,
        })
    }

    /// Returns a copy on another device.
    pub fn to_device(&self, device: &Device) -> Result<Self, NetworkError> {
        Ok(Self {
            variable: on_device(&self.variable, device)?,
            entries: self.entries.clone(),
            dropout: self.dropout,
        })
    }

    pub fn variable(&self) -> &Var {
        &self.variable
    }

    /// Returns the start of the last layer in the variable.
    pub fn last_layer(&self) -> usize {
        self.entries[2].range.start
    }

    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Computes the network's outputs for each moment [moments, outputs], from the values [moments, 1024] of both cameras; `random` draws
    /// the dropout mask in training.
    pub fn forward(
        &self,
        joined: &Tensor,
        random: Option<&mut impl Rng>,
    ) -> Result<Tensor, NetworkError> {
        let parts: Result<Vec<_>, _> = self
            .entries
            .iter()
            .map(|e| e.view(&self.variable))
            .collect();
        let [weight, bias, last_weight, last_bias] = &parts?[..] else {
            unreachable!("two layers have four parts")
        };
        let hidden = joined.silu()?.matmul(&weight.t()?)?.broadcast_add(bias)?;
        let mut hidden = hidden.silu()?;
        if let Some(random) = random
            && self.dropout > 0.0
        {
            let gains = gains(random, hidden.elem_count(), self.dropout);
            hidden = (&hidden * Tensor::from_vec(gains, hidden.shape(), hidden.device())?)?;
        }
        Ok(hidden.matmul(&last_weight.t()?)?.broadcast_add(last_bias)?)
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    use super::*;

    #[test]
    fn a_camera_is_left_out_as_often_as_asked_and_never_both() {
        let draws: Vec<_> = (0..4000)
            .map(|step| branch_gains(&mut stream(1, Purpose::FusionDropout, step), 0.2))
            .collect();
        // Both are kept with probability 0.8², otherwise one of them.
        let z = |gains: [f64; 2], p: f64| {
            let found = draws.iter().filter(|&&draw| draw == gains).count() as f64;
            let n = draws.len() as f64;
            let z = (found - n * p) / (n * p * (1.0 - p)).sqrt();
            assert!(z.abs() < 4.0, "{gains:?}: {z:.1} standard errors"); // 6e-5 each
        };
        z([1.0, 1.0], 0.64);
        z([2.0, 0.0], 0.18);
        z([0.0, 2.0], 0.18);
    }

    fn silu(x: f64) -> f64 {
        x / (1.0 + (-x).exp())
    }

    /// The same layers in f64, from flat parameters.
    fn plain(parameters: &[f64], joined: &[f64]) -> f64 {
        let columns = 2 * LATE_OUTPUTS;
        let (weight, rest) = parameters.split_at(HIDDEN * columns);
        let (bias, rest) = rest.split_at(HIDDEN);
        let (last_weight, last_bias) = rest.split_at(HIDDEN);
        let active: Vec<f64> = joined.iter().map(|&x| silu(x)).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let hidden: Vec<f64> = weight
            .chunks(columns)
            .zip(bias)
            .map(|(row, bias)| silu(dot(row, &active) + bias))
            .collect();
        dot(last_weight, &hidden) + last_bias[0]
    }

    #[test]
    fn answer_and_gradients_of_late_fusion_are_those_of_f64() {
        let fusion = LateFusion::new(3, 0.3, 1).unwrap();
        let mut random = stream(4, Purpose::Sampling, 0);
        let mut normal = |count: usize| -> Vec<f32> {
            StandardNormal
                .sample_iter(&mut random)
                .take(count)
                .collect()
        };
        let joined = normal(2 * LATE_OUTPUTS);
        let input = Var::from_vec(joined.clone(), (1, joined.len()), &Device::Cpu).unwrap();
        let output = fusion.forward(&input, None::<&mut ChaCha8Rng>).unwrap();
        let gradients = output.sum_all().unwrap().backward().unwrap();
        let doubles = |values: &[f32]| -> Vec<f64> { values.iter().map(|&x| x.into()).collect() };
        let parameters = doubles(&fusion.variable.to_vec1().unwrap());
        let joined = doubles(&joined);
        let output = f64::from(output.flatten_all().unwrap().to_vec1::<f32>().unwrap()[0]);
        assert!((output - plain(&parameters, &joined)).abs() < 1e-5);
        // The difference quotient along a random direction of each tensor: its error is (1e-4)² of third derivatives.
        let check =
            |name: &str, gradient: &[f32], direction: &[f64], moved: &dyn Fn(f64) -> f64| {
                let found: f64 = doubles(gradient)
                    .iter()
                    .zip(direction)
                    .map(|(g, d)| g * d)
                    .sum();
                let expected = (moved(1e-4) - moved(-1e-4)) / 2e-4;
                let size = doubles(gradient).iter().map(|g| g * g).sum::<f64>().sqrt();
                assert!(
                    (found - expected).abs() < 1e-4 * size,
                    "{name}: {found} expected {expected}"
                );
            };
        let along = |start: &[f64], from: usize, direction: &[f64], step: f64| {
            let mut moved = start.to_vec();
            for (x, d) in moved[from..].iter_mut().zip(direction) {
                *x += step * d;
            }
            moved
        };
        let of_parameters = gradients
            .get(&fusion.variable)
            .unwrap()
            .to_vec1::<f32>()
            .unwrap();
        for entry in &fusion.entries {
            let direction = doubles(&normal(entry.range.len()));
            check(
                &entry.name,
                &of_parameters[entry.range.clone()],
                &direction,
                &|step| {
                    plain(
                        &along(&parameters, entry.range.start, &direction, step),
                        &joined,
                    )
                },
            );
        }
        let of_input = gradients.get(&input).unwrap().flatten_all().unwrap();
        let direction = doubles(&normal(joined.len()));
        check(
            "values of both cameras",
            &of_input.to_vec1().unwrap(),
            &direction,
            &|step| plain(&parameters, &along(&joined, 0, &direction, step)),
        );
    }
}
