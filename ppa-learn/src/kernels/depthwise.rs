//! Forward depthwise convolution, row by row.

use pulp::{Simd, WithSimd};

use super::buffer::{Buffer, Pool};
use super::simd::{dispatch, fma, lanes, lanes_mut};

/// Kernel and stride of a convolution; padding is (kernel - 1) / 2 on every side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    pub kernel: usize,
    pub stride: usize,
}

impl Window {
    pub fn new(kernel: usize, stride: usize) -> Self {
        Self { kernel, stride }
    }

    pub fn padding(self) -> usize {
        (self.kernel - 1) / 2
    }

    /// Returns the output length for an input side of `len`.
    pub fn output(self, len: usize) -> usize {
        (len - 1) / self.stride + 1
    }
}

/// Runs a kernel that is generic in (kernel, stride), for the windows used in the network.
macro_rules! for_window {
    ($window:expr, $channels:expr, $kernel:ident { $($field:tt)* }) => {
        match ($window.kernel, $window.stride) {
            (3, 1) => dispatch($channels, $kernel::<3, 1> { $($field)* }),
            (3, 2) => dispatch($channels, $kernel::<3, 2> { $($field)* }),
            (5, 1) => dispatch($channels, $kernel::<5, 1> { $($field)* }),
            (5, 2) => dispatch($channels, $kernel::<5, 2> { $($field)* }),
            (kernel, stride) => unreachable!("a {kernel}x{kernel} window with stride {stride}"),
        }
    };
}
pub(crate) use for_window;

/// Computes one row of the output [width, channels] from `kernel` rows of the input [width + 2 padding, channels].
///
/// `weights` is [kernel, kernel, channels].
pub fn forward_row(
    window: Window,
    rows: &[&[f32]],
    weights: &[f32],
    channels: usize,
    out: &mut [f32],
) {
    assert_eq!(rows.len(), window.kernel);
    for_window!(
        window,
        channels,
        ForwardRow {
            rows,
            weights,
            channels,
            out
        }
    );
}

struct ForwardRow<'a, const K: usize, const STRIDE: usize> {
    rows: &'a [&'a [f32]],
    weights: &'a [f32],
    channels: usize,
    out: &'a mut [f32],
}

impl<const K: usize, const STRIDE: usize> WithSimd for ForwardRow<'_, K, STRIDE> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let width = self.out.len() / self.channels;
        let row: [&[S::f32s]; K] = std::array::from_fn(|ky| lanes::<S>(self.rows[ky]));
        let weights = lanes::<S>(self.weights);
        let blocks = weights.len() / (K * K);
        let out = lanes_mut::<S>(self.out);
        let mut x = 0;
        while x + 8 <= width {
            forward_block::<S, K, STRIDE, 8>(simd, row, weights, blocks, x, out);
            x += 8;
        }
        while x + 2 <= width {
            forward_block::<S, K, STRIDE, 2>(simd, row, weights, blocks, x, out);
            x += 2;
        }
        if x < width {
            forward_block::<S, K, STRIDE, 1>(simd, row, weights, blocks, x, out);
        }
    }
}

/// Computes `B` pixels of a row from `x` on, all channels.
#[inline(always)]
fn forward_block<S: Simd, const K: usize, const STRIDE: usize, const B: usize>(
    simd: S,
    rows: [&[S::f32s]; K],
    weights: &[S::f32s],
    blocks: usize,
    x: usize,
    out: &mut [S::f32s],
) {
    for block in 0..blocks {
        let mut sums = [simd.splat_f32s(0.0); B];
        for ky in 0..K {
            let row = &rows[ky][x * STRIDE * blocks + block..];
            for kx in 0..K {
                let weight = weights[(ky * K + kx) * blocks + block];
                for j in 0..B {
                    sums[j] = fma(simd, row[(j * STRIDE + kx) * blocks], weight, sums[j]);
                }
            }
        }
        for j in 0..B {
            out[(x + j) * blocks + block] = sums[j];
        }
    }
}

/// Transposes [channels, kernel, kernel] to [kernel, kernel, channels].
pub fn channels_last(weights: &[f32], channels: usize) -> Vec<f32> {
    let taps = weights.len() / channels;
    let mut turned = vec![0.0; weights.len()];
    for (tap, turned) in turned.chunks_exact_mut(channels).enumerate() {
        for (turned, weights) in turned.iter_mut().zip(weights.chunks_exact(taps)) {
            *turned = weights[tap];
        }
    }
    turned
}

/// Transposes [kernel, kernel, channels] to [channels, kernel, kernel].
pub fn channels_first(weights: &[f32], channels: usize) -> Vec<f32> {
    let taps = weights.len() / channels;
    (0..weights.len())
        .map(|i| weights[i % taps * channels + i / taps])
        .collect()
}

/// Ring buffer of padded rows of an image: row `y` replaces row `y - count`.
pub struct Rows {
    /// A row of zeros, followed by the rows.
    values: Buffer,
    pub count: usize,
    pub height: usize,
    row: usize,
    margin: usize,
}

impl Rows {
    /// Allocates `count` rows, to be cleared before each image.
    pub fn new(
        pool: &Pool,
        count: usize,
        height: usize,
        width: usize,
        padding: usize,
        channels: usize,
    ) -> Self {
        let row = (width + 2 * padding) * channels;
        Self {
            values: pool.take((count + 1) * row),
            count,
            height,
            row,
            margin: padding * channels,
        }
    }

    /// Sets all values to zero.
    pub fn clear(&mut self) {
        self.values.fill(0.0);
    }

    fn start(&self, y: usize) -> usize {
        (1 + y % self.count) * self.row
    }

    /// Returns the place of row `y`, without its padding.
    pub fn place(&mut self, y: usize) -> &mut [f32] {
        let start = self.start(y);
        &mut self.values[start + self.margin..start + self.row - self.margin]
    }

    /// Returns row `y` with its padding; zeros above and below the image.
    pub fn padded(&self, y: isize) -> &[f32] {
        match usize::try_from(y) {
            Ok(y) if y < self.height => &self.values[self.start(y)..][..self.row],
            _ => &self.values[..self.row],
        }
    }

    /// Returns row `y` of the image without its padding.
    pub fn inner(&self, y: usize) -> &[f32] {
        &self.values[self.start(y)..][self.margin..self.row - self.margin]
    }
}
