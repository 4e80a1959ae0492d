//! Gradients of a depthwise convolution, row by row.

use pulp::{Simd, WithSimd};

use super::depthwise::{Window, for_window};
use super::simd::{dispatch, fma, lanes, lanes_mut};

/// Adds the contribution of one output row to the gradient of the weights [kernel, kernel, channels].
///
/// `rows` are the padded rows of the input, `gradient` the gradient of the output row without padding.
pub fn add_weight_gradient(
    window: Window,
    rows: &[&[f32]],
    gradient: &[f32],
    channels: usize,
    sums: &mut [f32],
) {
    assert_eq!(rows.len(), window.kernel);
    for_window!(
        window,
        channels,
        WeightRow {
            rows,
            gradient,
            channels,
            sums
        }
    );
}

struct WeightRow<'a, const K: usize, const STRIDE: usize> {
    rows: &'a [&'a [f32]],
    gradient: &'a [f32],
    channels: usize,
    sums: &'a mut [f32],
}

impl<const K: usize, const STRIDE: usize> WithSimd for WeightRow<'_, K, STRIDE> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let width = self.gradient.len() / self.channels;
        let rows: [&[S::f32s]; K] = std::array::from_fn(|ky| lanes::<S>(self.rows[ky]));
        let gradient = lanes::<S>(self.gradient);
        let sums = lanes_mut::<S>(self.sums);
        let mut x = 0;
        while x + 8 <= width {
            weight_block::<S, K, STRIDE, 8>(simd, rows, gradient, x, sums);
            x += 8;
        }
        while x < width {
            weight_block::<S, K, STRIDE, 1>(simd, rows, gradient, x, sums);
            x += 1;
        }
    }
}

/// Adds the contribution of `B` pixels of a row from `x` on, all channels.
#[inline(always)]
fn weight_block<S: Simd, const K: usize, const STRIDE: usize, const B: usize>(
    simd: S,
    rows: [&[S::f32s]; K],
    gradient: &[S::f32s],
    x: usize,
    sums: &mut [S::f32s],
) {
    let blocks = sums.len() / (K * K);
    for block in 0..blocks {
        let gradient: [S::f32s; B] = std::array::from_fn(|j| gradient[(x + j) * blocks + block]);
        for ky in 0..K {
            let row = &rows[ky][x * STRIDE * blocks + block..];
            for kx in 0..K {
                let sum = &mut sums[(ky * K + kx) * blocks + block];
                let mut total = *sum;
                for j in 0..B {
                    total = fma(simd, gradient[j], row[(j * STRIDE + kx) * blocks], total);
                }
                *sum = total;
            }
        }
    }
}

/// Gradient of one input row of a depthwise convolution, through the activation before it.
pub struct InputRow<'a> {
    /// The padded rows of the output's gradient to which row `y` of the input contributed, each with its row of the kernel.
    pub rows: &'a [(usize, &'a [f32])],
    /// [kernel, kernel, channels].
    pub weights: &'a [f32],
    /// Derivative of the activation at each value of the row.
    pub derivative: &'a [f32],
    /// Values before normalisation and activation, and each channel's mean.
    pub pixels: &'a [f32],
    pub mean: &'a [f32],
    /// The gradient of the activation's input.
    pub out: &'a mut [f32],
    /// Accumulated sums of `out` of each channel, then of `out` (pixels - mean) of each channel.
    pub sums: &'a mut [f32],
}

impl InputRow<'_> {
    pub fn run(self, window: Window) {
        let row = self;
        for_window!(window, row.mean.len(), Gather { row });
    }
}

struct Gather<'a, const K: usize, const STRIDE: usize> {
    row: InputRow<'a>,
}

/// The slices of [`InputRow`] as vectors.
struct Vectors<'a, S: Simd> {
    rows: &'a [(usize, &'a [S::f32s])],
    weights: &'a [S::f32s],
    derivative: &'a [S::f32s],
    pixels: &'a [S::f32s],
    mean: &'a [S::f32s],
    out: &'a mut [S::f32s],
    sums: &'a mut [S::f32s],
}

impl<const K: usize, const STRIDE: usize> WithSimd for Gather<'_, K, STRIDE> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let row = self.row;
        let width = row.out.len() / row.mean.len();
        let mut gradients: [(usize, &[S::f32s]); K] = [(0, &[]); K];
        for (to, (ky, from)) in gradients.iter_mut().zip(row.rows) {
            *to = (*ky, lanes::<S>(from));
        }
        let mut vectors = Vectors::<S> {
            rows: &gradients[..row.rows.len()],
            weights: lanes::<S>(row.weights),
            derivative: lanes::<S>(row.derivative),
            pixels: lanes::<S>(row.pixels),
            mean: lanes::<S>(row.mean),
            out: lanes_mut::<S>(row.out),
            sums: lanes_mut::<S>(row.sums),
        };
        let mut x = 0; // always even, as stride 2 needs
        while x + 8 <= width {
            gather_block::<S, K, STRIDE, 8>(simd, &mut vectors, x);
            x += 8;
        }
        while x + 2 <= width {
            gather_block::<S, K, STRIDE, 2>(simd, &mut vectors, x);
            x += 2;
        }
        if x < width {
            gather_block::<S, K, STRIDE, 1>(simd, &mut vectors, x);
        }
    }
}

/// Input pixel x receives from output pixel (x + p - kx) / stride if that is an integer; p is the padding, here also of the
/// output rows.
#[inline(always)]
fn gather_block<S: Simd, const K: usize, const STRIDE: usize, const B: usize>(
    simd: S,
    row: &mut Vectors<S>,
    x: usize,
) {
    let blocks = row.mean.len();
    let padding = (K - 1) / 2;
    for block in 0..blocks {
        let mut sums = [simd.splat_f32s(0.0); B];
        for &(ky, gradient) in row.rows {
            let gradient = &gradient[x / STRIDE * blocks + block..];
            for kx in 0..K {
                let weight = row.weights[(ky * K + kx) * blocks + block];
                for (j, sum) in sums.iter_mut().enumerate() {
                    // The output rows begin `padding` pixels before their image, which also keeps the difference positive.
                    let ahead = j + padding + STRIDE * padding - kx;
                    if ahead.is_multiple_of(STRIDE) {
                        *sum = fma(simd, gradient[ahead / STRIDE * blocks], weight, *sum);
                    }
                }
            }
        }
        let (mut first, mut second) = (row.sums[block], row.sums[blocks + block]);
        for (j, sum) in sums.into_iter().enumerate() {
            let at = (x + j) * blocks + block;
            let gradient = simd.mul_f32s(sum, row.derivative[at]);
            row.out[at] = gradient;
            first = simd.add_f32s(first, gradient);
            second = fma(
                simd,
                gradient,
                simd.sub_f32s(row.pixels[at], row.mean[block]),
                second,
            );
        }
        row.sums[block] = first;
        row.sums[blocks + block] = second;
    }
}
