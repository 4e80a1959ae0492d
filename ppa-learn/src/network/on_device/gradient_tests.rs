//! Gradients of the operations of devices against finite differences, over random shapes.

use candle_core::{DType, Device, Result, Tensor};
use proptest::prelude::*;
use rand_distr::{Distribution, StandardNormal};

use super::depthwise::{depthwise, of_input, of_weights};
use super::normalise::{Gradient, Normed};
use super::parameters::{Gradients, Parameters};
use super::reduce;
use super::squeeze::Gate;
use crate::kernels::depthwise::Window;
use crate::network::{LinearPlace, SqueezePlace};
use crate::random::{Purpose, stream};

fn normal(shape: &[usize], seed: u64) -> Tensor {
    let random = stream(seed, Purpose::Sampling, 0);
    let count = shape.iter().product();
    let values: Vec<f32> = StandardNormal.sample_iter(random).take(count).collect();
    Tensor::from_vec(values, shape, &Device::Cpu).unwrap()
}

/// Returns the dot product of two tensors, in f64.
fn dot(a: &Tensor, b: &Tensor) -> f64 {
    let [a, b] = [a, b].map(|x| x.to_dtype(DType::F64).unwrap());
    (a * b).unwrap().sum_all().unwrap().to_scalar().unwrap()
}

/// Checks the gradient of each input of `operation` against a finite difference in a random direction.
/// `gradients` computes the gradients from the inputs and the gradient of the output.
fn check<const N: usize>(
    inputs: [Tensor; N],
    operation: impl Fn(&[Tensor; N]) -> Result<Tensor>,
    gradients: impl Fn(&[Tensor; N], &Tensor) -> Result<[Tensor; N]>,
) {
    let output = operation(&inputs).unwrap();
    let weights = normal(output.dims(), 77);
    let gradients = gradients(&inputs, &weights).unwrap();
    for (index, gradient) in gradients.iter().enumerate() {
        let direction = normal(inputs[index].dims(), 78 + index as u64);
        let step = 2e-3;
        let moved = |sign: f64| {
            let mut moved = inputs.clone();
            let offset = (&direction * (sign * step)).unwrap();
            moved[index] = (&inputs[index] + offset).unwrap();
            dot(&operation(&moved).unwrap(), &weights)
        };
        let expected = (moved(1.0) - moved(-1.0)) / (2.0 * step);
        let found = dot(gradient, &direction);
        // The scale of a directional derivative is the length of the gradient.
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
        check(
            [x, weights.clone()],
            |[x, weights]| depthwise(x, weights, window),
            |[x, weights], gradient| {
                Ok([of_input(gradient, weights, window, x)?, of_weights(x, gradient, window)?])
            },
        );
        // One channel for all.
        let image = normal(&[images, height, width, 1], seed);
        check(
            [weights],
            |[weights]| depthwise(&image, weights, window),
            |_, gradient| Ok([of_weights(&image, gradient, window)?]),
        );
    }

    #[test]
    fn normalisation_has_the_gradients_of_finite_differences(
        (images, height, width, channels) in (1_usize..4, 1_usize..12, 2_usize..12, 1_usize..9),
        activated in any::<bool>(),
        seed in 0_u64..1000,
    ) {
        let x = (normal(&[images, height, width, channels], seed) + 3.0).unwrap();
        let affine = normal(&[2, channels], seed + 1);
        let factor = &normal(&[images, channels], seed + 2);
        let normed = |[x, affine]: &[Tensor; 2]| Normed::by_batch(x.clone(), affine, activated);
        check(
            [x.clone(), affine.clone()],
            |inputs| normed(inputs)?.image(Some(factor), None),
            |inputs, image| {
                let of = Gradient { image: Some(image), factor: Some(factor), addend: None };
                normed(inputs)?.gradients(of).map(<[Tensor; 2]>::from)
            },
        );
        if activated {
            // The mean of each image, and the sums of each with another image.
            let other = &normal(x.dims(), seed + 3);
            let pixels = (height * width) as f64;
            check(
                [x, affine],
                |inputs| normed(inputs)?.mean()? + normed(inputs)?.dot(other)?,
                |inputs, of| {
                    let each = (of / pixels)?;
                    let of = Gradient { image: Some(other), factor: Some(of), addend: Some(&each) };
                    normed(inputs)?.gradients(of).map(<[Tensor; 2]>::from)
                },
            );
        }
    }

    #[test]
    fn gates_have_the_gradients_of_finite_differences(
        (images, channels, squeezed) in (1_usize..5, 1_usize..9, 1_usize..4), seed in 0_u64..1000,
    ) {
        let place = |start: usize, outputs: usize, inputs: usize| LinearPlace {
            weight: start..start + outputs * inputs,
            bias: start + outputs * inputs..start + outputs * (inputs + 1),
        };
        let squeeze = place(0, squeezed, channels);
        let expand = place(squeeze.bias.end, channels, squeezed);
        let length = expand.bias.end;
        let place = SqueezePlace { squeeze, expand };
        let gate = |[pooled, parameters]: &[Tensor; 2]| {
            Gate::new(&place, Parameters(parameters), pooled.clone())
        };
        check(
            [normal(&[images, channels], seed), normal(&[length], seed + 1)],
            |inputs| Ok(gate(inputs)?.gates),
            |inputs, of_gates| {
                let mut gradients = Gradients::default();
                let parameters = Parameters(&inputs[1]);
                let of_pooled = gate(inputs)?.backward(&place, parameters, of_gates, &mut gradients)?;
                Ok([of_pooled, gradients.flat()?])
            },
        );
    }

    #[test]
    fn parts_add_up_to_their_sum(parts in 1_usize..5000, values in 1_usize..4) {
        let numbers: Vec<f32> = (0..parts * values).map(|n| (n % 7) as f32).collect();
        let tensor = Tensor::from_vec(numbers, (parts, values), &Device::Cpu).unwrap();
        let expected: Vec<f32> = tensor.sum(0).unwrap().to_vec1().unwrap();
        prop_assert_eq!(reduce::sum(tensor).unwrap().to_vec1::<f32>().unwrap(), expected);
    }
}

#[test]
fn a_window_sums_what_lies_under_it_and_zeros_around() {
    // With ones in image and window: the number of image pixels under each position of the window.
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
    let x = Tensor::from_vec(values, (2, 100, 100, 1), &Device::Cpu).unwrap();
    let affine = Tensor::ones((2, 1), DType::F32, &Device::Cpu).unwrap();
    let moments = Normed::by_batch(x, &affine, false).unwrap().moments();
    let found = moments.unwrap().map(|m| m.to_vec1::<f32>().unwrap()[0]);
    let unbiased = 20_000.0 / 19_999.0;
    assert!(
        (found[0] - 1001.0).abs() < 1e-4 && (found[1] - unbiased).abs() < 1e-5,
        "{found:?}"
    );
}
