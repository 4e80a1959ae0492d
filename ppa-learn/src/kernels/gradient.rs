//! Backward kernels around batch normalisation, each over a run of pixels that fits the cache.
//!
//! With y = gamma x̂ + beta, x̂ = (x - mean) / sigma over M pixels, and g the gradient of y
//! (Ioffe and Szegedy 2015, arXiv:1502.03167): dbeta = sum g, dgamma = sum g x̂, and
//! dx = gamma / sigma (g - dbeta / M - x̂ dgamma / M), which is linear in g and x for each channel.

use pulp::{Simd, WithSimd};

use super::batch_norm::{Affine, add};
use super::simd::{dispatch, fma, lanes, lanes_mut, silu_and_derivative};

/// dx = of_gradient g + of_input x + constant for each channel.
#[derive(Debug, Clone)]
pub struct Linear {
    pub of_gradient: Vec<f32>,
    pub of_input: Vec<f32>,
    pub constant: Vec<f32>,
}

/// out = `linear` applied to the gradient times `gain` and to the pixels.
pub fn combine(gradient: &[f32], pixels: &[f32], linear: &Linear, gain: f32, out: &mut [f32]) {
    dispatch(
        linear.constant.len(),
        Combine {
            gradient,
            pixels,
            linear,
            gain,
            out,
        },
    );
}

struct Combine<'a> {
    gradient: &'a [f32],
    pixels: &'a [f32],
    linear: &'a Linear,
    gain: f32,
    out: &'a mut [f32],
}

impl WithSimd for Combine<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let of_gradient = lanes::<S>(&self.linear.of_gradient);
        let of_input = lanes::<S>(&self.linear.of_input);
        let constant = lanes::<S>(&self.linear.constant);
        let gain = simd.splat_f32s(self.gain);
        let channels = constant.len();
        let gradients = lanes::<S>(self.gradient).chunks_exact(channels);
        let pixels = lanes::<S>(self.pixels).chunks_exact(channels);
        for ((gradient, pixel), out) in gradients
            .zip(pixels)
            .zip(lanes_mut::<S>(self.out).chunks_exact_mut(channels))
        {
            for c in 0..channels {
                let g = simd.mul_f32s(gradient[c], gain);
                out[c] = fma(
                    simd,
                    g,
                    of_gradient[c],
                    fma(simd, pixel[c], of_input[c], constant[c]),
                );
            }
        }
    }
}

/// Adds sum g and sum g (x - mean) of each channel to the first and second half of `sums`, where g is the gradient times `gain`.
pub fn add_gradient_sums(
    gradient: &[f32],
    pixels: &[f32],
    mean: &[f32],
    gain: f32,
    sums: &mut [f64],
) {
    let mut part = vec![0.0; sums.len()];
    dispatch(
        mean.len(),
        GradientSums {
            gradient,
            pixels,
            mean,
            sums: &mut part,
        },
    );
    part.iter_mut().for_each(|sum| *sum *= gain);
    add(sums, &part);
}

struct GradientSums<'a> {
    gradient: &'a [f32],
    pixels: &'a [f32],
    mean: &'a [f32],
    sums: &'a mut [f32],
}

impl WithSimd for GradientSums<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let mean = lanes::<S>(self.mean);
        let channels = mean.len();
        let (first, second) = lanes_mut::<S>(self.sums).split_at_mut(channels);
        let gradients = lanes::<S>(self.gradient).chunks_exact(channels);
        for (gradient, pixel) in gradients.zip(lanes::<S>(self.pixels).chunks_exact(channels)) {
            for c in 0..channels {
                first[c] = simd.add_f32s(first[c], gradient[c]);
                second[c] = fma(
                    simd,
                    gradient[c],
                    simd.sub_f32s(pixel[c], mean[c]),
                    second[c],
                );
            }
        }
    }
}

/// Sums over the pixels of one image, for each channel, for the gradient of a gated activation a = SiLU(y), y = affine(x).
///
/// u is the gradient of the gated activation. Gate and pooled gradient are the same for all pixels of an image, so
/// everything that depends on them follows from these sums.
#[derive(Debug, Clone)]
pub struct ActivationSums {
    /// sum u a
    pub gate: Vec<f64>,
    /// sum u a' and sum u a' (x - mean)
    pub upstream: Vec<f64>,
    /// sum a' and sum a' (x - mean)
    pub derivative: Vec<f64>,
}

impl ActivationSums {
    pub fn zeros(channels: usize) -> Self {
        Self {
            gate: vec![0.0; channels],
            upstream: vec![0.0; 2 * channels],
            derivative: vec![0.0; 2 * channels],
        }
    }

    /// Adds a run of pixels of the image; u is 0 if `upstream` is `None`.
    pub fn add(&mut self, upstream: Option<&[f32]>, pixels: &[f32], affine: &Affine, mean: &[f32]) {
        let channels = mean.len();
        let mut part = vec![0.0; 5 * channels];
        dispatch(
            channels,
            Sums {
                upstream,
                pixels,
                affine,
                mean,
                sums: &mut part,
            },
        );
        add(&mut self.gate, &part[..channels]);
        add(&mut self.upstream, &part[channels..3 * channels]);
        add(&mut self.derivative, &part[3 * channels..]);
    }
}

struct Sums<'a> {
    upstream: Option<&'a [f32]>,
    pixels: &'a [f32],
    affine: &'a Affine,
    mean: &'a [f32],
    sums: &'a mut [f32],
}

impl WithSimd for Sums<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (scale, shift) = (
            lanes::<S>(&self.affine.scale),
            lanes::<S>(&self.affine.shift),
        );
        let mean = lanes::<S>(self.mean);
        let channels = mean.len();
        let upstream = self.upstream.map(lanes::<S>);
        let sums = lanes_mut::<S>(self.sums);
        for (index, pixel) in lanes::<S>(self.pixels).chunks_exact(channels).enumerate() {
            let upstream = upstream.map(|values| &values[index * channels..][..channels]);
            for c in 0..channels {
                let y = fma(simd, pixel[c], scale[c], shift[c]);
                let (value, derivative) = silu_and_derivative(simd, y);
                let d = simd.sub_f32s(pixel[c], mean[c]);
                if let Some(upstream) = upstream {
                    let product = simd.mul_f32s(upstream[c], derivative);
                    sums[c] = fma(simd, upstream[c], value, sums[c]);
                    sums[channels + c] = simd.add_f32s(sums[channels + c], product);
                    sums[2 * channels + c] = fma(simd, product, d, sums[2 * channels + c]);
                }
                sums[3 * channels + c] = simd.add_f32s(sums[3 * channels + c], derivative);
                sums[4 * channels + c] = fma(simd, derivative, d, sums[4 * channels + c]);
            }
        }
    }
}

/// Gradient of x through normalisation and SiLU, if the gradient of the activation is upstream * gate + pooled.
pub struct ActivationGradient<'a> {
    pub upstream: Option<&'a [f32]>,
    pub pixels: &'a [f32],
    pub affine: &'a Affine,
    pub linear: &'a Linear,
    /// One value for each channel of this image.
    pub gate: &'a [f32],
    pub pooled: &'a [f32],
    pub out: &'a mut [f32],
}

impl ActivationGradient<'_> {
    pub fn run(self) {
        dispatch(self.pooled.len(), self);
    }
}

impl WithSimd for ActivationGradient<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (scale, shift) = (
            lanes::<S>(&self.affine.scale),
            lanes::<S>(&self.affine.shift),
        );
        let of_gradient = lanes::<S>(&self.linear.of_gradient);
        let of_input = lanes::<S>(&self.linear.of_input);
        let constant = lanes::<S>(&self.linear.constant);
        let (gate, pooled) = (lanes::<S>(self.gate), lanes::<S>(self.pooled));
        let channels = pooled.len();
        let upstream = self.upstream.map(lanes::<S>);
        let pixels = lanes::<S>(self.pixels).chunks_exact(channels);
        for (index, (pixel, out)) in pixels
            .zip(lanes_mut::<S>(self.out).chunks_exact_mut(channels))
            .enumerate()
        {
            let upstream = upstream.map(|values| &values[index * channels..][..channels]);
            for c in 0..channels {
                let y = fma(simd, pixel[c], scale[c], shift[c]);
                let (_, derivative) = silu_and_derivative(simd, y);
                let of_activation =
                    upstream.map_or(pooled[c], |u| fma(simd, u[c], gate[c], pooled[c]));
                let g = simd.mul_f32s(of_activation, derivative);
                out[c] = fma(
                    simd,
                    g,
                    of_gradient[c],
                    fma(simd, pixel[c], of_input[c], constant[c]),
                );
            }
        }
    }
}
