//! Initial values of the parameters, and random gains of untrained layers.

use rand::{Rng, RngExt};
use rand_distr::{Distribution, Normal, Uniform};

use super::architecture::{Architecture, Entry};
use crate::random::{Purpose, stream};

/// Returns initial values of the backbone and of the classifier; each parameter has its own random stream.
pub fn parameters(architecture: &Architecture, seed: u64) -> (Vec<f32>, Vec<f32>) {
    let mut index = 0;
    let mut fill = |entries: &[Entry]| {
        let mut values = Vec::new();
        for entry in entries {
            let mut random = stream(seed, Purpose::Weights, index);
            index += 1;
            values.extend((0..entry.range.len()).map(sampler(entry, &mut random)));
        }
        values
    };
    (fill(&architecture.backbone), fill(&architecture.classifier))
}

fn sampler<'a>(entry: &Entry, random: &'a mut impl Rng) -> Box<dyn FnMut(usize) -> f32 + 'a> {
    match entry.shape[..] {
        // He et al. 2015 (arXiv:1502.01852) with torch's fan-out, which does not divide by the groups of a depthwise convolution.
        [out, _, height, width] => {
            let deviation = (2.0 / (out * height * width) as f32).sqrt();
            let normal = Normal::new(0.0, deviation).expect("a deviation is finite");
            Box::new(move |_| normal.sample(random))
        }
        [out, _] => {
            let bound = 1.0 / (out as f32).sqrt();
            let uniform = Uniform::new(-bound, bound).expect("a bound is positive");
            Box::new(move |_| uniform.sample(random))
        }
        // The weight of a normalisation is 1; every bias is 0. Only normalisations have a weight of one dimension.
        _ if entry.name.ends_with(".weight") => Box::new(|_| 1.0),
        _ => Box::new(|_| 0.0),
    }
}

/// Returns running means of 0 and variances of 1.
pub fn statistics(architecture: &Architecture) -> Vec<f32> {
    let entries = architecture.statistics.iter();
    entries
        .flat_map(|entry| {
            let value = if entry.name.ends_with("running_var") {
                1.0
            } else {
                0.0
            };
            std::iter::repeat_n(value, entry.range.len())
        })
        .collect()
}

/// Draws 0 with probability `drop`, otherwise 1 / (1 - drop), so that the mean is 1.
pub fn gains(random: &mut impl Rng, count: usize, drop: f32) -> Vec<f32> {
    let kept = 1.0 / (1.0 - drop);
    (0..count)
        .map(|_| {
            if random.random::<f32>() < drop {
                0.0
            } else {
                kept
            }
        })
        .collect()
}
