//! Normal numbers addressed by (seed, purpose, index).

use std::f64::consts::TAU;

use ppa_core::random::{Philox, philox};

/// Purposes of random numbers. Part of the contract that seeds give the same images: append, never renumber.
#[derive(Debug, Clone, Copy)]
#[repr(u32)]
pub(crate) enum Purpose {
    RangeNoise = 0,
    DeviceError = 1,
    FixedPattern = 2,
    Tremor = 3,
}

/// Four independent standard normal numbers, the `block`-th of item `index` (a frame, a camera).
#[inline]
pub(crate) fn normals(seed: u64, purpose: Purpose, index: u64, block: u32) -> [f64; 4] {
    let counter = [index as u32, (index >> 32) as u32, block, purpose as u32];
    let [a, b, c, d] = philox(counter, Philox::key(seed));
    // Box and Muller 1958; the middle of each of 2³² steps, so that the logarithm stays finite.
    let uniform = |bits: u32| (f64::from(bits) + 0.5) / 4_294_967_296.0;
    let pair = |radius: u32, angle: u32| {
        let r = (-2.0 * uniform(radius).ln()).sqrt();
        let (sin, cos) = (TAU * uniform(angle)).sin_cos();
        [r * cos, r * sin]
    };
    let ([p, q], [s, t]) = (pair(a, b), pair(c, d));
    [p, q, s, t]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_have_mean_0_and_variance_1() {
        let n = 50_000_u32;
        let all = (0..n / 4).flat_map(|block| normals(7, Purpose::RangeNoise, 3, block));
        let (sum, squares) = all.fold((0.0, 0.0), |(s, q), x| (s + x, q + x * x));
        let n = f64::from(n);
        // Standard errors 1/√n and √(2/n), four of each.
        assert!((sum / n).abs() < 4.0 / n.sqrt());
        assert!((squares / n - 1.0).abs() < 4.0 * (2.0 / n).sqrt());
    }
}
