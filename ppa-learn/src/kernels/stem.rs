//! The first convolution: one channel in, 3 x 3 with stride 2 and padding 1.

use pulp::{Simd, WithSimd};

use super::simd::{dispatch, fma, lanes, lanes_mut};

/// Number of taps of the kernel.
pub const TAPS: usize = 9;

/// Returns the pixels under the kernel at output pixel (y, x) of an image; zeros outside it.
fn neighbours(image: &[f32], width: usize, y: usize, x: usize) -> [f32; TAPS] {
    std::array::from_fn(|tap| {
        let (y, x) = (
            (2 * y + tap / 3).wrapping_sub(1),
            (2 * x + tap % 3).wrapping_sub(1),
        );
        let inside = x < width && y < image.len() / width;
        if inside { image[y * width + x] } else { 0.0 }
    })
}

/// Writes the neighbours [width of the output, taps] of the pixels of output row `y`.
pub fn neighbours_of_row(image: &[f32], width: usize, y: usize, out: &mut [f32]) {
    // A zero before each row, and one or two after it.
    let mut padded = vec![0.0; width + 3];
    for ky in 0..3 {
        let row = (2 * y + ky)
            .checked_sub(1)
            .and_then(|y| image.chunks_exact(width).nth(y));
        match row {
            Some(row) => padded[1..=width].copy_from_slice(row),
            None => padded.fill(0.0),
        }
        let under = padded.windows(3).step_by(2);
        for (out, under) in out.chunks_exact_mut(TAPS).zip(under) {
            out[3 * ky..3 * ky + 3].copy_from_slice(under);
        }
    }
}

/// Computes output row `y` [width of the output, channels] from an image in rows of `width`; `weights` are [3, 3, channels].
pub fn forward_row(image: &[f32], width: usize, y: usize, weights: &[f32], out: &mut [f32]) {
    let channels = weights.len() / TAPS;
    dispatch(
        channels,
        ForwardRow {
            image,
            width,
            y,
            weights,
            out,
        },
    );
}

struct ForwardRow<'a> {
    image: &'a [f32],
    width: usize,
    y: usize,
    weights: &'a [f32],
    out: &'a mut [f32],
}

impl WithSimd for ForwardRow<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let weights = lanes::<S>(self.weights);
        let channels = weights.len() / TAPS;
        for (x, out) in lanes_mut::<S>(self.out)
            .chunks_exact_mut(channels)
            .enumerate()
        {
            let under = neighbours(self.image, self.width, self.y, x);
            for c in 0..channels {
                let mut sum = simd.splat_f32s(0.0);
                for tap in 0..TAPS {
                    sum = fma(
                        simd,
                        simd.splat_f32s(under[tap]),
                        weights[tap * channels + c],
                        sum,
                    );
                }
                out[c] = sum;
            }
        }
    }
}

/// Adds the contribution of output row `y` to the gradient of the weights [3, 3, channels].
pub fn add_weight_gradient(
    image: &[f32],
    width: usize,
    y: usize,
    gradient: &[f32],
    sums: &mut [f32],
) {
    let channels = sums.len() / TAPS;
    dispatch(
        channels,
        WeightRow {
            image,
            width,
            y,
            gradient,
            sums,
        },
    );
}

struct WeightRow<'a> {
    image: &'a [f32],
    width: usize,
    y: usize,
    gradient: &'a [f32],
    sums: &'a mut [f32],
}

impl WithSimd for WeightRow<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let sums = lanes_mut::<S>(self.sums);
        let channels = sums.len() / TAPS;
        for (x, gradient) in lanes::<S>(self.gradient).chunks_exact(channels).enumerate() {
            let under = neighbours(self.image, self.width, self.y, x);
            for c in 0..channels {
                for tap in 0..TAPS {
                    let sum = &mut sums[tap * channels + c];
                    *sum = fma(simd, simd.splat_f32s(under[tap]), gradient[c], *sum);
                }
            }
        }
    }
}
