//! Forward kernels around batch normalisation, each over a run of pixels that fits the cache.

use pulp::{Simd, WithSimd};

use super::simd::{dispatch, fma, lanes, lanes_mut, sigmoid, silu_and_derivative};

/// y = scale x + shift for each channel: a normalisation with known moments.
#[derive(Debug, Clone, Default)]
pub struct Affine {
    pub scale: Vec<f32>,
    pub shift: Vec<f32>,
}

/// Adds sum (x - center) and sum (x - center)^2 of each channel to the first and the second half of `sums`.
pub fn add_moments(pixels: &[f32], center: &[f32], sums: &mut [f64]) {
    let channels = center.len();
    let mut part = vec![0.0; 2 * channels];
    // Few enough values that their f32 sum is accurate to 1e-6.
    for pixels in pixels.chunks(64 * channels) {
        part.fill(0.0);
        dispatch(
            channels,
            Moments {
                pixels,
                center,
                sums: &mut part,
            },
        );
        add(sums, &part);
    }
}

/// Adds the f32 sums over a run of pixels to the f64 sums over all of them.
pub fn add(sums: &mut [f64], part: &[f32]) {
    for (sum, part) in sums.iter_mut().zip(part) {
        *sum += f64::from(*part);
    }
}

struct Moments<'a> {
    pixels: &'a [f32],
    center: &'a [f32],
    sums: &'a mut [f32],
}

impl WithSimd for Moments<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let center = lanes::<S>(self.center);
        let (first, second) = lanes_mut::<S>(self.sums).split_at_mut(center.len());
        for pixel in lanes::<S>(self.pixels).chunks_exact(center.len()) {
            for (((x, center), first), second) in
                pixel.iter().zip(center).zip(&mut *first).zip(&mut *second)
            {
                let d = simd.sub_f32s(*x, *center);
                *first = simd.add_f32s(*first, d);
                *second = fma(simd, d, d, *second);
            }
        }
    }
}

/// out = SiLU(affine(x)), times the gate of its channel if there are gates.
pub fn activate(pixels: &[f32], affine: &Affine, gate: Option<&[f32]>, out: &mut [f32]) {
    dispatch(
        affine.scale.len(),
        Activate {
            pixels,
            affine,
            gate,
            out,
        },
    );
}

struct Activate<'a> {
    pixels: &'a [f32],
    affine: &'a Affine,
    gate: Option<&'a [f32]>,
    out: &'a mut [f32],
}

impl WithSimd for Activate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (scale, shift) = (
            lanes::<S>(&self.affine.scale),
            lanes::<S>(&self.affine.shift),
        );
        let channels = scale.len();
        let pixels = lanes::<S>(self.pixels).chunks_exact(channels);
        for (pixel, out) in pixels.zip(lanes_mut::<S>(self.out).chunks_exact_mut(channels)) {
            for (((x, scale), shift), out) in pixel.iter().zip(scale).zip(shift).zip(&mut *out) {
                let y = fma(simd, *x, *scale, *shift);
                *out = simd.mul_f32s(y, sigmoid(simd, y));
            }
            if let Some(gate) = self.gate {
                for (out, gate) in out.iter_mut().zip(lanes::<S>(gate)) {
                    *out = simd.mul_f32s(*out, *gate);
                }
            }
        }
    }
}

/// Adds sum SiLU(affine(x)) of each channel to `sums`.
pub fn add_activated(pixels: &[f32], affine: &Affine, sums: &mut [f64]) {
    let mut part = vec![0.0; sums.len()];
    dispatch(
        sums.len(),
        Squeeze {
            pixels,
            affine,
            sums: &mut part,
        },
    );
    add(sums, &part);
}

struct Squeeze<'a> {
    pixels: &'a [f32],
    affine: &'a Affine,
    sums: &'a mut [f32],
}

impl WithSimd for Squeeze<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (scale, shift) = (
            lanes::<S>(&self.affine.scale),
            lanes::<S>(&self.affine.shift),
        );
        let sums = lanes_mut::<S>(self.sums);
        for pixel in lanes::<S>(self.pixels).chunks_exact(scale.len()) {
            for (((x, scale), shift), sum) in pixel.iter().zip(scale).zip(shift).zip(&mut *sums) {
                let y = fma(simd, *x, *scale, *shift);
                *sum = fma(simd, y, sigmoid(simd, y), *sum);
            }
        }
    }
}

/// out = gain affine(x), plus the block's input if it is added.
pub fn normalise(
    pixels: &[f32],
    affine: &Affine,
    gain: f32,
    added: Option<&[f32]>,
    out: &mut [f32],
) {
    let (scale, shift) = (&affine.scale[..], &affine.shift[..]);
    let channels = scale.len();
    for (index, (pixel, out)) in pixels
        .chunks_exact(channels)
        .zip(out.chunks_exact_mut(channels))
        .enumerate()
    {
        for (((x, scale), shift), out) in pixel.iter().zip(scale).zip(shift).zip(&mut *out) {
            *out = gain * (x * scale + shift);
        }
        if let Some(added) = added {
            for (out, added) in out.iter_mut().zip(&added[index * channels..]) {
                *out += added;
            }
        }
    }
}

/// Computes SiLU(y) and its derivative with respect to y = affine(x).
pub fn activate_with_derivative(
    pixels: &[f32],
    affine: &Affine,
    value: &mut [f32],
    derivative: &mut [f32],
) {
    dispatch(
        affine.scale.len(),
        Both {
            pixels,
            affine,
            value,
            derivative,
        },
    );
}

struct Both<'a> {
    pixels: &'a [f32],
    affine: &'a Affine,
    value: &'a mut [f32],
    derivative: &'a mut [f32],
}

impl WithSimd for Both<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (scale, shift) = (
            lanes::<S>(&self.affine.scale),
            lanes::<S>(&self.affine.shift),
        );
        let channels = scale.len();
        let values = lanes_mut::<S>(self.value).chunks_exact_mut(channels);
        let derivatives = lanes_mut::<S>(self.derivative).chunks_exact_mut(channels);
        for ((pixel, value), derivative) in lanes::<S>(self.pixels)
            .chunks_exact(channels)
            .zip(values)
            .zip(derivatives)
        {
            for c in 0..channels {
                let y = fma(simd, pixel[c], scale[c], shift[c]);
                (value[c], derivative[c]) = silu_and_derivative(simd, y);
            }
        }
    }
}
