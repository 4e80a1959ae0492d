//! Forward and backward passes against finite differences of the plain network, over random shapes.

use proptest::prelude::*;
use rand_distr::{Distribution, StandardNormal};

use super::architecture::{Architecture, Stage};
use super::backward::Backward;
use super::folded::Folded;
use super::forward::Forward;
use super::inference::Inference;
use super::norm::MOMENTUM;
use super::reference::{Maps, features};
use super::tape::Size;
use super::{Purpose, initialise, stream};
use crate::kernels::buffer::Pool;

const DROP: f32 = 0.4;

/// A stem and a stage without expansion, then two stages of one or two blocks, with channels that need all widths of vectors.
fn shapes() -> impl Strategy<Value = (usize, [Stage; 3], Size)> {
    let channels = || prop::sample::select(vec![3_usize, 4, 8, 16]);
    let stage = move || {
        (
            prop::sample::select(vec![2_usize, 4]),
            prop::sample::select(vec![3_usize, 5]),
            1..=2_usize,
            channels(),
            1..=2_usize,
        )
    };
    let size = (2..=9_usize, 9..=24_usize, 9..=24_usize).prop_map(|(images, height, width)| Size {
        images,
        height,
        width,
    });
    (channels(), channels(), stage(), stage(), size)
        .prop_filter("the first block adds nothing", |(stem, first, ..)| {
            stem != first
        })
        .prop_map(|(stem, first, second, third, size)| {
            (stem, [(1, 3, 1, first, 1), second, third], size)
        })
}

fn normal(count: usize, seed: u64) -> Vec<f32> {
    let mut random = stream(seed, Purpose::Sampling, 0);
    (0..count)
        .map(|_| StandardNormal.sample(&mut random))
        .collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn outputs_and_gradients_are_those_of_the_plain_network((stem, stages, size) in shapes(), seed in 0..1000_u64) {
        let architecture = Architecture::of_stages(stem, &stages, 16, 1, DROP);
        let (mut parameters, _) = initialise::parameters(&architecture, seed);
        // Away from the initial 0 and 1, so that every term of a gradient counts.
        let disturbance = normal(parameters.len(), seed + 1);
        parameters.iter_mut().zip(disturbance).for_each(|(x, d)| *x += 0.1 * d);
        let images = normal(size.count(), seed + 2);
        let pool = Pool::default();

        let mut random = stream(seed, Purpose::Dropout, 0);
        let mut statistics = initialise::statistics(&architecture);
        let forward = Forward { architecture: &architecture, parameters: &parameters, statistics: &mut statistics, pool: &pool, momentum: MOMENTUM, random: Some(&mut random), blocks: Vec::new() };
        let (out, tape) = forward.run(&images, size);
        let of_features = normal(out.len(), seed + 3);
        let mut gradients = vec![f32::NAN; parameters.len()];
        Backward { architecture: &architecture, parameters: &parameters, gradients: &mut gradients, pool: &pool }.run(tape, &of_features);

        let mut random = stream(seed, Purpose::Dropout, 0);
        let residual = architecture.blocks.iter().filter(|block| block.residual);
        let gains: Vec<Vec<f32>> = residual.map(|block| initialise::gains(&mut random, size.images, block.drop)).collect();
        let values = images.chunks(size.pixels()).map(|image| vec![image.iter().map(|&x| x.into()).collect()]).collect();
        let maps = Maps { values, height: size.height, width: size.width };
        let run = |parameters: &[f64]| features(&architecture, parameters, maps.clone(), &gains);
        let plain: Vec<f64> = parameters.iter().map(|&x| x.into()).collect();
        for (ours, plain) in out.iter().zip(run(&plain)) {
            prop_assert!((f64::from(*ours) - plain).abs() < 1e-4, "{ours} {plain}");
        }
        let of_features: Vec<f64> = of_features.iter().map(|&x| x.into()).collect();
        let gradients: Vec<f64> = gradients.iter().map(|&x| x.into()).collect();
        for (index, entry) in architecture.backbone.iter().enumerate() {
            // The difference quotient along one random direction for each tensor: its error is (1e-5)^2 of third derivatives.
            let direction: Vec<f64> = normal(entry.range.len(), seed + 10 + index as u64).iter().map(|&x| x.into()).collect();
            let moved = |step: f64| {
                let mut parameters = plain.clone();
                parameters[entry.range.clone()].iter_mut().zip(&direction).for_each(|(x, d)| *x += step * d);
                dot(&of_features, &run(&parameters))
            };
            let expected = (moved(1e-5) - moved(-1e-5)) / 2e-5;
            let gradient = &gradients[entry.range.clone()];
            // The product with a normal direction has the size of the gradient. Gradients that are zero in theory are sums
            // that cancel in f32, with an error proportional to the total gradient.
            let allowed = 1e-3 * dot(gradient, gradient).sqrt() + 1e-5 * dot(&gradients, &gradients).sqrt();
            let error = (dot(gradient, &direction) - expected).abs();
            prop_assert!(error < allowed, "{}: {} expected {expected}", entry.name, dot(gradient, &direction));
        }
    }

    #[test]
    fn inference_by_batch_moments_equals_training((stem, stages, size) in shapes(), seed in 0..1000_u64) {
        let architecture = Architecture::of_stages(stem, &stages, 16, 1, 0.0);
        let (mut parameters, _) = initialise::parameters(&architecture, seed);
        let disturbance = normal(parameters.len(), seed + 1);
        parameters.iter_mut().zip(disturbance).for_each(|(x, d)| *x += 0.1 * d);
        let images = normal(size.count(), seed + 2);
        let pool = Pool::default();
        let mut statistics = initialise::statistics(&architecture);
        let mut random = stream(seed, Purpose::Dropout, 0);
        let forward = Forward { architecture: &architecture, parameters: &parameters, statistics: &mut statistics, pool: &pool, momentum: MOMENTUM, random: Some(&mut random), blocks: Vec::new() };
        let (trained, tape) = forward.run(&images, size);

        let mut moments = vec![0.0; statistics.len()];
        let of_blocks = architecture.blocks.iter().zip(&tape.blocks).flat_map(|(block, tape)| {
            [(&block.expand, &tape.expand), (&block.depthwise, &tape.depthwise), (&block.project, &tape.project)]
        });
        for (place, normed) in of_blocks.chain([(&architecture.head, &tape.head)]) {
            moments[place.norm.mean.clone()].copy_from_slice(&normed.norm.mean);
            let weights = &parameters[place.norm.weight.clone()];
            let variances = moments[place.norm.variance.clone()].iter_mut();
            for ((variance, weight), scale) in variances.zip(weights).zip(&normed.norm.affine.scale) {
                *variance = (weight / scale).powi(2) - 1e-5;
            }
        }
        let folded = Folded::new(&architecture, &parameters, &moments, &pool);
        let inference = Inference { architecture: &architecture, folded: &folded, parameters: &parameters, pool: &pool };
        for (inferred, trained) in inference.run(&images, size).iter().zip(&trained) {
            prop_assert!((inferred - trained).abs() < 1e-4 * (1.0 + trained.abs()), "{inferred} {trained}");
        }
    }
}
