//! Pointwise convolution in inference: a product with prearranged weights, activated in registers.

use pulp::{Simd, WithSimd};

use super::panel_rows::PanelRows;
use super::panels::{PANEL, Panels, groups, widest};
use super::simd::{dispatch, fma, lanes, silu, store};

/// Computes SiLU(convolution) of pixels [pixels, columns], few enough for the second-level cache: `out` [pixels, channels].
pub fn activated(input: &[f32], panels: &Panels, out: &mut [f32]) {
    let channels = panels.channels();
    forward::<true>(input, panels, None, channels, pixel_by_pixel(channels), out);
}

/// [`activated`], channels of pixel `p` in a panel apart from the others: in rows of `width` pixels, of which row `y` begins at `start(y)`.
pub fn activated_rows(
    input: &[f32],
    panels: &Panels,
    width: usize,
    first: usize,
    out: &mut PanelRows,
) {
    let count = input.len() / panels.columns();
    let places: Vec<usize> = (0..count / width)
        .flat_map(|y| {
            let start = out.start(first + y);
            (0..width).map(move |x| start + x * PANEL)
        })
        .collect();
    let panel = out.panel();
    let place =
        |pixel: usize, channel: usize| places[pixel] + channel / PANEL * panel + channel % PANEL;
    let stored = panels.channels().next_multiple_of(PANEL);
    forward::<true>(input, panels, None, stored, place, out.values_mut());
}

/// out = convolution of pixels [pixels, columns], plus the block's input if it is added.
pub fn normalised(input: &[f32], panels: &Panels, added: Option<&[f32]>, out: &mut [f32]) {
    let channels = panels.channels();
    forward::<false>(
        input,
        panels,
        added,
        channels,
        pixel_by_pixel(channels),
        out,
    );
}

/// Returns the index of a channel of a pixel in [pixels, channels].
fn pixel_by_pixel(channels: usize) -> impl Fn(usize, usize) -> usize {
    move |pixel, channel| pixel * channels + channel
}

fn forward<const ACTIVATE: bool>(
    input: &[f32],
    panels: &Panels,
    added: Option<&[f32]>,
    stored: usize,
    place: impl Fn(usize, usize) -> usize,
    out: &mut [f32],
) {
    dispatch(
        PANEL,
        Forward::<ACTIVATE, _> {
            input,
            panels,
            added,
            stored,
            place,
            out,
        },
    );
}

struct Forward<'a, const ACTIVATE: bool, P> {
    input: &'a [f32],
    panels: &'a Panels,
    added: Option<&'a [f32]>,
    /// Number of channels to store.
    stored: usize,
    /// Output index of a channel of a pixel; the channels of a vector are next to each other.
    place: P,
    out: &'a mut [f32],
}

impl<const ACTIVATE: bool, P: Fn(usize, usize) -> usize> WithSimd for Forward<'_, ACTIVATE, P> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        // One group of channels after the other for all pixels, so that its weights stay in the cache.
        for (first, width) in groups(self.panels.channels(), widest::<S>()) {
            // As many sums as fit into the registers next to the weights.
            match width / S::F32_LANES {
                1 => self.group::<S, 8, 1>(simd, first),
                2 if S::F32_LANES == PANEL => self.group::<S, 8, 2>(simd, first),
                2 => self.group::<S, 6, 2>(simd, first),
                3 => self.group::<S, 8, 3>(simd, first),
                4 => self.group::<S, 6, 4>(simd, first),
                _ => self.group::<S, 1, PANEL>(simd, first),
            }
        }
    }
}

impl<const ACTIVATE: bool, P: Fn(usize, usize) -> usize> Forward<'_, ACTIVATE, P> {
    /// Computes the channels of one group, from `first` on, for all pixels.
    #[inline(always)]
    fn group<S: Simd, const M: usize, const V: usize>(&mut self, simd: S, first: usize) {
        let columns = self.panels.columns();
        let pixels = self.input.len() / columns;
        let width = V * S::F32_LANES;
        let weights = lanes::<S>(&self.panels.values[first * columns..][..width * columns]);
        let shift = lanes::<S>(&self.panels.shift[first..][..width]);
        let shift: [S::f32s; V] = std::array::from_fn(|v| shift[v]);
        for start in (0..pixels).step_by(M) {
            // Pixels beyond the last one repeat it.
            let row = |m: usize| &self.input[(start + m).min(pixels - 1) * columns..][..columns];
            let sums = tile::<S, M, V>(simd, std::array::from_fn(row), weights, shift);
            for (m, sums) in sums.into_iter().enumerate() {
                if start + m < pixels {
                    self.store(simd, start + m, first, sums);
                }
            }
        }
    }

    /// Stores the channels of a pixel from `first` on.
    #[inline(always)]
    fn store<S: Simd, const V: usize>(
        &mut self,
        simd: S,
        pixel: usize,
        first: usize,
        sums: [S::f32s; V],
    ) {
        for (v, sum) in sums.into_iter().enumerate() {
            let channel = first + v * S::F32_LANES;
            let count = self.stored.saturating_sub(channel).min(S::F32_LANES);
            if count == 0 {
                return;
            }
            let at = (self.place)(pixel, channel);
            let at = at..at + count;
            let y = match self.added {
                Some(added) => simd.add_f32s(sum, simd.partial_load_f32s(&added[at.clone()])),
                None => sum,
            };
            let y = if ACTIVATE { silu(simd, y) } else { y };
            store::<S>(simd, y, &mut self.out[at]);
        }
    }
}

/// Sums over all columns for M pixels and V vectors of channels, starting from `shift`.
#[inline(always)]
fn tile<S: Simd, const M: usize, const V: usize>(
    simd: S,
    rows: [&[f32]; M],
    weights: &[S::f32s],
    shift: [S::f32s; V],
) -> [[S::f32s; V]; M] {
    let mut sums = [shift; M];
    // Four columns at a time, so that bounds are checked once for all of them.
    let (weights, _) = weights.as_chunks::<V>();
    let (fours, rest) = weights.as_chunks::<4>();
    for (number, weights) in fours.iter().enumerate() {
        let mut x = [&[0.0; 4]; M];
        for m in 0..M {
            x[m] = &rows[m].as_chunks::<4>().0[number];
        }
        for k in 0..4 {
            for m in 0..M {
                let x = simd.splat_f32s(x[m][k]);
                for v in 0..V {
                    sums[m][v] = fma(simd, x, weights[k][v], sums[m][v]);
                }
            }
        }
    }
    for (k, weights) in rest.iter().enumerate() {
        for m in 0..M {
            let x = simd.splat_f32s(rows[m][4 * fours.len() + k]);
            for v in 0..V {
                sums[m][v] = fma(simd, x, weights[v], sums[m][v]);
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::batch_norm::Affine;
    use crate::kernels::buffer::Pool;
    use crate::kernels::panels::LayOut;
    use proptest::prelude::*;

    /// Computes the convolution with vectors other than the widest.
    fn by<S: Simd>(simd: S, input: &[f32], weight: &[f32], affine: &Affine) -> Vec<f32> {
        let mut panels = Panels::new(weight, affine, &Pool::default());
        let (scale, values) = (&affine.scale[..], &mut panels.values[..]);
        let lay_out = LayOut {
            weight,
            scale,
            values,
        };
        simd.vectorize(lay_out);
        let mut out = vec![0.0; input.len() / panels.columns() * panels.channels()];
        let stored = panels.channels();
        simd.vectorize(Forward::<false, _> {
            input,
            panels: &panels,
            added: None,
            stored,
            place: pixel_by_pixel(stored),
            out: &mut out,
        });
        out
    }

    proptest! {
        #[test]
        fn convolutions_are_those_of_the_definition(
            (pixels, channels, columns) in (1_usize..80, 1_usize..70, 1_usize..40),
            gated in any::<bool>(),
            seed in 0_u32..1000,
        ) {
            let value = |i: usize| ((i as u32 * 7919 + seed * 31) % 17) as f32 - 8.0;
            let values = |count: usize| -> Vec<f32> { (0..count).map(value).collect() };
            let (input, weight, added) = (values(pixels * columns), values(channels * columns), values(pixels * channels));
            let affine = Affine { scale: values(channels), shift: values(channels) };
            let gate: Vec<f32> = if gated { values(columns) } else { vec![1.0; columns] };
            let pool = Pool::default();
            let panels = Panels::new(&weight, &affine, &pool);
            let panels = if gated { panels.gated(&gate, &pool) } else { panels };
            let expected: Vec<f32> = (0..pixels * channels)
                .map(|i| {
                    let (pixel, c) = (i / channels, i % channels);
                    let products = (0..columns).map(|k| input[pixel * columns + k] * gate[k] * weight[c * columns + k]);
                    affine.shift[c] + affine.scale[c] * products.sum::<f32>()
                })
                .collect();

            let mut out = vec![0.0; pixels * channels];
            normalised(&input, &panels, None, &mut out);
            prop_assert_eq!(&out, &expected); // whole numbers below 2^24: exact
            if !gated {
                prop_assert_eq!(&by(pulp::Scalar, &input, &weight, &affine), &expected);
                #[cfg(target_arch = "x86_64")]
                if let Some(simd) = pulp::x86::V3::try_new() {
                    prop_assert_eq!(&by(simd, &input, &weight, &affine), &expected);
                }
            }
            normalised(&input, &panels, Some(&added), &mut out);
            let sums: Vec<f32> = expected.iter().zip(&added).map(|(x, added)| x + added).collect();
            prop_assert_eq!(&out, &sums);

            let silu = |x: f32| x / (1.0 + (-x).exp());
            let close = |out: f32, x: f32| (out - silu(x)).abs() <= 1e-6 * silu(x).abs() + 1e-6;
            activated(&input, &panels, &mut out);
            for (out, x) in out.iter().zip(&expected) {
                prop_assert!(close(*out, *x), "{out} {x}");
            }
            // The same as rows 2, 3 and so on of an image with four columns and a padding of two.
            let whole = pixels / 4 * 4;
            let mut rows = PanelRows::new(&pool, pixels.div_ceil(4) + 1, [pixels, 4], 2, channels);
            activated_rows(&input[..whole * columns], &panels, 4, 2, &mut rows);
            for (i, x) in expected[..whole * channels].iter().enumerate() {
                let (pixel, c) = (i / channels, i % channels);
                let at = rows.start(2 + pixel / 4) + pixel % 4 * PANEL + c / PANEL * rows.panel() + c % PANEL;
                let out = rows.values_mut()[at];
                prop_assert!(close(out, *x), "{out} {x}");
            }
        }
    }
}
