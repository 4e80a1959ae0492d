//! Gradients of the operations of devices against finite differences, over random shapes.

use candle_core::{DType, Device, Result, Tensor, Var};
use proptest::prelude::*;
use rand_distr::{Distribution, StandardNormal};

use super::depthwise::depthwise;
use super::normalise::{Moments, by_batch};
use crate::kernels::depthwise::Window;
use crate::random::{Purpose, stream};

fn normal(shape: &[usize], seed: u64) -> Tensor {
    let random = stream(seed, Purpose::Sampling, 0);
    let count = shape.iter().product();
    let values: Vec<f32> = StandardNormal.sample_iter(random).take(count).collect();
    Tensor::from_vec(values, shape, &Device::Cpu).unwrap()
}

/// The sum of the products of two tensors, in f64.
fn dot(a: &Tensor, b: &Tensor) -> f64 {
    let [a, b] = [a, b].map(|x| x.to_dtype(DType::F64).unwrap());
    (a * b).unwrap().sum_all().unwrap().to_scalar().unwrap()
}

/// That the gradient of each input of `operation`, in a random direction, is what a small step in that direction changes.
fn check(inputs: &[Tensor], operation: impl Fn(&[Tensor]) -> Result<Tensor>) {
    let variables: Vec<Var> = inputs
        .iter()
        .map(|x| Var::from_tensor(x).unwrap())
        .collect();
    let tracked: Vec<Tensor> = variables.iter().map(|x| x.as_tensor().clone()).collect();
    let output = operation(&tracked).unwrap();
    let weights = normal(output.dims(), 77);
    let gradients = (&output * &weights).unwrap().sum_all().unwrap().backward();
    let gradients = gradients.unwrap();
    for (index, variable) in variables.iter().enumerate() {
        let gradient = gradients.get(variable).unwrap();
        let direction = normal(variable.dims(), 78 + index as u64);
        let step = 2e-3;
        let moved = |sign: f64| {
            let mut moved = inputs.to_vec();
            let offset = (&direction * (sign * step)).unwrap();
            moved[index] = (&inputs[index] + offset).unwrap();
            dot(&operation(&moved).unwrap(), &weights)
        };
        let expected = (moved(1.0) - moved(-1.0)) / (2.0 * step);
        let found = dot(gradient, &direction);
        // A directional derivative scatters by the length of the gradient.
        let size = dot(gradient, gradient).sqrt();
        assert!(
            (found - expected).abs() < 5e-3 * (1.0 + size),
            "input {index}: {found}, expected {expected}, length {size}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    #[test]
    fn depthwise_has_the_gradients_of_finite_differences(
        (images, height, width, channels) in (1_usize..4, 1_usize..12, 1_usize..12, 1_usize..9),
        kernel in prop::sample::select(vec![3_usize, 5]),
        stride in 1_usize..3,
        seed in 0_u64..1000,
    ) {
        let window = Window { kernel, stride };
        let weights = normal(&[channels, kernel * kernel], seed + 1);
        let x = normal(&[images, height, width, channels], seed);
        check(&[x, weights.clone()], |inputs| depthwise(&inputs[0], &inputs[1], window));
        // One channel for all.
        let image = normal(&[images, height, width, 1], seed);
        check(&[weights], |inputs| depthwise(&image, &inputs[0], window));
    }

    #[test]
    fn normalisation_has_the_gradients_of_finite_differences(
        (pixels, channels) in (2_usize..300, 1_usize..9),
        activated in any::<bool>(),
        seed in 0_u64..1000,
    ) {
        let x = (normal(&[pixels, channels], seed) + 3.0).unwrap();
        let affine = normal(&[2, channels], seed + 1);
        check(&[x, affine], |inputs| {
            by_batch(&inputs[0], &inputs[1], &Moments::of(&inputs[0])?, activated)
        });
    }
}

#[test]
fn a_window_sums_what_lies_under_it_and_zeros_around() {
    // Ones under ones: the number of pixels of the image under each place of the window.
    let x = Tensor::ones((1, 3, 4, 2), DType::F32, &Device::Cpu).unwrap();
    let weights = Tensor::ones((2, 9), DType::F32, &Device::Cpu).unwrap();
    let found = |stride| -> Vec<f32> {
        let window = Window { kernel: 3, stride };
        let out = depthwise(&x, &weights, window).unwrap();
        out.narrow(3, 1, 1)
            .unwrap()
            .flatten_all()
            .unwrap()
            .to_vec1()
            .unwrap()
    };
    assert_eq!(found(1), [4., 6., 6., 4., 6., 9., 9., 6., 4., 6., 6., 4.]);
    assert_eq!(found(2), [4., 6., 4., 6.]);
}

#[test]
fn moments_keep_their_digits_far_from_zero() {
    // 1000 and 1002 in turn: mean 1001, variance 1.
    let values: Vec<f32> = (0..20_000).map(|i| 1000.0 + (i % 2) as f32 * 2.0).collect();
    let x = Tensor::from_vec(values, (20_000, 1), &Device::Cpu).unwrap();
    let Moments { mean, variance } = Moments::of(&x).unwrap();
    let found = [mean, variance].map(|m| m.to_vec1::<f32>().unwrap()[0]);
    assert!(
        (found[0] - 1001.0).abs() < 1e-4 && (found[1] - 1.0).abs() < 1e-5,
        "{found:?}"
    );
}
