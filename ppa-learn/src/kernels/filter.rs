//! Depthwise convolution in inference; its output is normalised, activated and pooled in registers.

use pulp::{Simd, WithSimd};

use super::batch_norm::Affine;
use super::buffer::{Buffer, Pool};
use super::depthwise::{Window, for_window};
use super::panel_rows::PanelRows;
use super::panels::PANEL;
use super::simd::{dispatch, fma, lanes, silu, store};

/// Weights of a depthwise convolution [panels, kernel, kernel, [`PANEL`]] with the normalisation after it folded in.
#[derive(Debug)]
pub struct Taps {
    values: Buffer,
    /// Shift of each channel, with zeros after the last one.
    shift: Vec<f32>,
    window: Window,
    channels: usize,
}

impl Taps {
    /// Lays out weights [channels, kernel, kernel] with the normalisation of their output.
    pub fn new(window: Window, weight: &[f32], affine: &Affine, pool: &Pool) -> Self {
        let channels = affine.scale.len();
        let taps = window.kernel * window.kernel;
        let mut values = pool.take(channels.next_multiple_of(PANEL) * taps);
        values.fill(0.0);
        for (c, (weight, scale)) in weight.chunks_exact(taps).zip(&affine.scale).enumerate() {
            for (tap, weight) in weight.iter().enumerate() {
                values[(c / PANEL * taps + tap) * PANEL + c % PANEL] = weight * scale;
            }
        }
        let mut shift = affine.shift.clone();
        shift.resize(channels.next_multiple_of(PANEL), 0.0);
        Self {
            values,
            shift,
            window,
            channels,
        }
    }
}

/// Computes SiLU(convolution) [output rows, width, channels] of rows from `first` on, and the sums [output rows, channels] of the rows.
pub fn filter_rows(taps: &Taps, rows: &PanelRows, first: isize, out: &mut [f32], sums: &mut [f32]) {
    for_window!(
        taps.window,
        PANEL,
        FilterRows {
            taps,
            rows,
            first,
            out,
            sums,
        }
    );
}

struct FilterRows<'a, const K: usize, const STRIDE: usize> {
    taps: &'a Taps,
    rows: &'a PanelRows,
    first: isize,
    out: &'a mut [f32],
    sums: &'a mut [f32],
}

impl<const K: usize, const STRIDE: usize> WithSimd for FilterRows<'_, K, STRIDE> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let rows = self.sums.len() / self.taps.channels;
        match pixels_at_once(self.out.len() / self.sums.len()) {
            8 => self.tiles::<S, 8>(simd, rows),
            7 => self.tiles::<S, 7>(simd, rows),
            6 => self.tiles::<S, 6>(simd, rows),
            3 => self.tiles::<S, 3>(simd, rows),
            2 => self.tiles::<S, 2>(simd, rows),
            _ => self.tiles::<S, 1>(simd, rows),
        }
    }
}

/// Returns the number of pixels of a row that are summed at once, each in its register: at least six if the row has as many, so that no
/// sum waits for the one before, and among these the number with the least overlap at the end of the row.
fn pixels_at_once(width: usize) -> usize {
    let fitting = [8, 7, 6, 3, 2, 1].into_iter().filter(|&b| b <= width);
    fitting
        .min_by_key(|&b| width.div_ceil(b) * b.max(6))
        .unwrap_or(1)
}

impl<const K: usize, const STRIDE: usize> FilterRows<'_, K, STRIDE> {
    /// Works panel by panel, so that rows stay in the first-level cache, and on `B` pixels at a time. The last pixels of a row overlap the
    /// ones before them.
    #[inline(always)]
    fn tiles<S: Simd, const B: usize>(self, simd: S, rows: usize) {
        let channels = self.taps.channels;
        let row = self.out.len() / rows;
        let width = row / channels;
        let vectors = PANEL / S::F32_LANES;
        let under = |y: usize| self.rows.under::<K>(self.first + (y * STRIDE) as isize);
        let under: Vec<_> = (0..rows).map(under).collect();
        let taps = lanes::<S>(&self.taps.values).chunks_exact(K * K * vectors);
        let shift = lanes::<S>(&self.taps.shift).chunks_exact(vectors);
        for (panel, (taps, shift)) in taps.zip(shift).enumerate() {
            for (v, &shift) in shift.iter().enumerate() {
                let from = (panel * PANEL + v * S::F32_LANES).min(channels);
                let to = channels.min(from + S::F32_LANES);
                let out = self.out.chunks_exact_mut(row);
                let out = out.zip(self.sums.chunks_exact_mut(channels));
                for (under, (out, sums)) in under.iter().zip(out) {
                    let rows = under.panel(panel).map(|row| lanes::<S>(row));
                    let mut sum = simd.splat_f32s(0.0);
                    for begin in (0..width).step_by(B) {
                        let x = begin.min(width - B);
                        let tile = tile::<S, K, STRIDE, B>(simd, rows, taps, shift, x, v);
                        for (x, sum_of_taps) in (x..).zip(tile) {
                            let y = silu(simd, sum_of_taps);
                            if x >= begin {
                                sum = simd.add_f32s(sum, y);
                            }
                            let pixel = x * channels;
                            store::<S>(simd, y, &mut out[pixel + from..pixel + to]);
                        }
                    }
                    store::<S>(simd, sum, &mut sums[from..to]);
                }
            }
        }
    }
}

/// Computes the convolution at `B` pixels from `x` on, for vector `v` of a panel.
#[inline(always)]
fn tile<S: Simd, const K: usize, const STRIDE: usize, const B: usize>(
    simd: S,
    rows: [&[S::f32s]; K],
    taps: &[S::f32s],
    shift: S::f32s,
    x: usize,
    v: usize,
) -> [S::f32s; B] {
    let vectors = PANEL / S::F32_LANES;
    let mut sums = [shift; B];
    for ky in 0..K {
        // Slices of known length, so that bounds are checked once.
        let row = &rows[ky][x * STRIDE * vectors..][..((B - 1) * STRIDE + K) * vectors];
        let taps = &taps[ky * K * vectors..][..K * vectors];
        for kx in 0..K {
            let tap = taps[kx * vectors + v];
            for j in 0..B {
                sums[j] = fma(simd, row[(j * STRIDE + kx) * vectors + v], tap, sums[j]);
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Filters an image through a ring buffer of rows, computing the output rows before their input is overwritten.
    fn by<S: Simd>(
        simd: Option<S>,
        taps: &Taps,
        image: &[f32],
        [height, width]: [usize; 2],
    ) -> (Vec<f32>, Vec<f32>) {
        let (channels, window) = (taps.channels, taps.window);
        let pool = Pool::default();
        let count = window.kernel;
        let mut rows = PanelRows::new(&pool, count, [height, width], window.padding(), channels);
        let (panel, row) = (rows.panel(), window.output(width) * channels);
        let mut out = vec![0.0; window.output(height) * row];
        let mut all_sums = vec![0.0; window.output(height) * channels];
        let mut next = 0;
        let parts = out.chunks_mut(row).zip(all_sums.chunks_mut(channels));
        for (y, (out, sums)) in parts.enumerate() {
            let first = (y * window.stride) as isize - window.padding() as isize;
            while next < height && (next as isize) < first + count as isize {
                let start = rows.start(next);
                for x in 0..width {
                    for c in 0..channels.next_multiple_of(PANEL) {
                        let at = start + x * PANEL + c / PANEL * panel + c % PANEL;
                        let value = image.get((next * width + x) * channels + c);
                        let value = value.filter(|_| c < channels);
                        rows.values_mut()[at] = value.copied().unwrap_or_default();
                    }
                }
                next += 1;
            }
            let Some(simd) = simd else {
                filter_rows(taps, &rows, first, out, sums);
                continue;
            };
            let rows = &rows;
            match (window.kernel, window.stride) {
                (3, 1) => simd.vectorize(FilterRows::<3, 1> {
                    taps,
                    rows,
                    first,
                    out,
                    sums,
                }),
                (3, 2) => simd.vectorize(FilterRows::<3, 2> {
                    taps,
                    rows,
                    first,
                    out,
                    sums,
                }),
                (5, 1) => simd.vectorize(FilterRows::<5, 1> {
                    taps,
                    rows,
                    first,
                    out,
                    sums,
                }),
                _ => simd.vectorize(FilterRows::<5, 2> {
                    taps,
                    rows,
                    first,
                    out,
                    sums,
                }),
            }
        }
        (out, all_sums)
    }

    proptest! {
        #[test]
        fn rows_are_those_of_the_definition(
            (kernel, stride) in prop_oneof![Just((3, 1)), Just((3, 2)), Just((5, 1)), Just((5, 2))],
            (height, width, channels) in (1_usize..12, 1_usize..30, 1_usize..40),
            seed in 0_u32..1000,
        ) {
            let value = |i: usize| ((i as u32 * 7919 + seed * 31) % 17) as f32 / 8.0 - 1.0;
            let values = |count: usize| -> Vec<f32> { (0..count).map(value).collect() };
            let window = Window::new(kernel, stride);
            let affine = Affine { scale: values(channels), shift: values(channels) };
            let (weight, image) = (values(channels * kernel * kernel), values(height * width * channels));
            let taps = Taps::new(window, &weight, &affine, &Pool::default());
            let (rows_out, columns_out) = (window.output(height), window.output(width));
            let mut expected = Vec::new();
            for i in 0..rows_out * columns_out * channels {
                let (y, x, c) = (i / channels / columns_out, i / channels % columns_out, i % channels);
                let mut sum = 0.0;
                for tap in 0..kernel * kernel {
                    let [y, x] = [y * stride + tap / kernel, x * stride + tap % kernel].map(|i| i.wrapping_sub(window.padding()));
                    if y < height && x < width {
                        sum += f64::from(weight[c * kernel * kernel + tap] * image[(y * width + x) * channels + c]);
                    }
                }
                let y = f64::from(affine.shift[c]) + f64::from(affine.scale[c]) * sum;
                expected.push(y / (1.0 + (-y).exp()));
            }
            let check = |(out, sums): (Vec<f32>, Vec<f32>)| {
                for (out, expected) in out.iter().zip(&expected) {
                    prop_assert!((f64::from(*out) - expected).abs() < 1e-5, "{out} {expected}");
                }
                for (i, sum) in sums.iter().enumerate() {
                    let pixels = (0..columns_out).map(|x| expected[(i / channels * columns_out + x) * channels + i % channels]);
                    let expected: f64 = pixels.sum();
                    prop_assert!((f64::from(*sum) - expected).abs() < 3e-4, "{sum} {expected}");
                }
                Ok(())
            };
            check(by::<pulp::Scalar>(None, &taps, &image, [height, width]))?;
            check(by(Some(pulp::Scalar), &taps, &image, [height, width]))?;
            #[cfg(target_arch = "x86_64")]
            if let Some(simd) = pulp::x86::V3::try_new() {
                check(by(Some(simd), &taps, &image, [height, width]))?;
            }
        }
    }
}
