//! Reference implementation of the network in plain f64, image by image and pixel by pixel, channels first, following the equations.

use super::architecture::{Architecture, Block, ConvPlace};

/// [images][channels][pixels of height x width]
#[derive(Clone)]
pub struct Maps {
    pub values: Vec<Vec<Vec<f64>>>,
    pub height: usize,
    pub width: usize,
}

fn silu(x: f64) -> f64 {
    x / (1.0 + (-x).exp())
}

/// A convolution with zero padding (kernel - 1) / 2; `groups` is 1 or the number of channels.
fn conv(
    input: &Maps,
    weight: &[f64],
    channels: usize,
    kernel: usize,
    stride: usize,
    groups: usize,
) -> Maps {
    let (height, width) = (
        (input.height - 1) / stride + 1,
        (input.width - 1) / stride + 1,
    );
    let per_group = input.values[0].len() / groups;
    let padding = (kernel as isize - 1) / 2;
    let pixel = |image: &[Vec<f64>], channel: usize, y: usize, x: usize| {
        let mut sum = 0.0;
        for c in 0..per_group {
            let plane = &image[if groups == 1 { c } else { channel }];
            for (ky, kx) in (0..kernel * kernel).map(|tap| (tap / kernel, tap % kernel)) {
                let (sy, sx) = (
                    (y * stride + ky) as isize - padding,
                    (x * stride + kx) as isize - padding,
                );
                if (0..input.height as isize).contains(&sy)
                    && (0..input.width as isize).contains(&sx)
                {
                    let tap = weight[((channel * per_group + c) * kernel + ky) * kernel + kx];
                    sum += tap * plane[sy as usize * input.width + sx as usize];
                }
            }
        }
        sum
    };
    let plane = |image: &[Vec<f64>], channel| {
        (0..height * width)
            .map(|i| pixel(image, channel, i / width, i % width))
            .collect()
    };
    let values = input
        .values
        .iter()
        .map(|image| (0..channels).map(|channel| plane(image, channel)).collect())
        .collect();
    Maps {
        values,
        height,
        width,
    }
}

/// Normalisation by the batch, in place.
fn normalise(maps: &mut Maps, place: &ConvPlace, parameters: &[f64]) {
    for c in 0..place.channels {
        let all: Vec<f64> = maps
            .values
            .iter()
            .flat_map(|image| &image[c])
            .copied()
            .collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let variance = all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / all.len() as f64;
        let (weight, bias) = (
            parameters[place.norm.weight.start + c],
            parameters[place.norm.bias.start + c],
        );
        for x in maps.values.iter_mut().flat_map(|image| &mut image[c]) {
            *x = weight * (*x - mean) / (variance + 1e-5).sqrt() + bias;
        }
    }
}

fn activate(maps: &mut Maps) {
    maps.values
        .iter_mut()
        .flatten()
        .flatten()
        .for_each(|x| *x = silu(*x));
}

fn means(image: &[Vec<f64>]) -> Vec<f64> {
    image
        .iter()
        .map(|plane| plane.iter().sum::<f64>() / plane.len() as f64)
        .collect()
}

fn linear(input: &[f64], weight: &[f64], bias: &[f64]) -> Vec<f64> {
    let rows = weight.chunks(input.len()).zip(bias);
    rows.map(|(row, bias)| bias + row.iter().zip(input).map(|(a, b)| a * b).sum::<f64>())
        .collect()
}

fn block(block: &Block, first: bool, input: Maps, parameters: &[f64], gains: &[f32]) -> Maps {
    let part = |range: &std::ops::Range<usize>| &parameters[range.clone()];
    let (kernel, stride) = if first { (3, 2) } else { (1, 1) };
    let expanded = block.expand.channels;
    let mut maps = conv(
        &input,
        part(&block.expand.weight),
        expanded,
        kernel,
        stride,
        1,
    );
    normalise(&mut maps, &block.expand, parameters);
    activate(&mut maps);
    maps = conv(
        &maps,
        part(&block.depthwise.weight),
        expanded,
        block.depthwise.window.kernel,
        block.depthwise.window.stride,
        expanded,
    );
    normalise(&mut maps, &block.depthwise, parameters);
    activate(&mut maps);
    for image in &mut maps.values {
        let place = &block.squeeze;
        let hidden = linear(
            &means(image),
            part(&place.squeeze.weight),
            part(&place.squeeze.bias),
        );
        let hidden: Vec<f64> = hidden.into_iter().map(silu).collect();
        let gates = linear(
            &hidden,
            part(&place.expand.weight),
            part(&place.expand.bias),
        );
        for (plane, gate) in image.iter_mut().zip(gates) {
            plane.iter_mut().for_each(|x| *x /= 1.0 + (-gate).exp());
        }
    }
    maps = conv(
        &maps,
        part(&block.project.weight),
        block.project.channels,
        1,
        1,
        1,
    );
    normalise(&mut maps, &block.project, parameters);
    if block.residual {
        for ((image, added), gain) in maps
            .values
            .iter_mut()
            .flatten()
            .zip(input.values.iter().flatten())
            .zip(
                gains
                    .iter()
                    .flat_map(|gain| std::iter::repeat_n(gain, block.project.channels)),
            )
        {
            image
                .iter_mut()
                .zip(added)
                .for_each(|(x, added)| *x = f64::from(*gain) * *x + added);
        }
    }
    maps
}

/// Computes features [images * features] in training, with the gains of stochastic depth of each residual block in order.
pub fn features(
    architecture: &Architecture,
    parameters: &[f64],
    images: Maps,
    gains: &[Vec<f32>],
) -> Vec<f64> {
    let mut maps = images;
    let mut gains = gains.iter();
    for (index, place) in architecture.blocks.iter().enumerate() {
        let kept: &[f32] = if place.residual {
            gains.next().expect("gains of a residual block")
        } else {
            &[]
        };
        maps = block(place, index == 0, maps, parameters, kept);
    }
    let head = &architecture.head;
    maps = conv(
        &maps,
        &parameters[head.weight.clone()],
        head.channels,
        1,
        1,
        1,
    );
    normalise(&mut maps, head, parameters);
    activate(&mut maps);
    maps.values.iter().flat_map(|image| means(image)).collect()
}
