//! Random numbers addressed by (seed, purpose, index): Philox4x32-10.
//!
//! Salmon, Moraes, Dror, Shaw, *Parallel random numbers: as easy as 1, 2, 3*, SC 2011, doi:10.1145/2063384.2063405.

use std::f64::consts::TAU;

/// What numbers are for. Part of the contract that seeds give the same images: append, never renumber.
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
    let [a, b, c, d] = philox(counter, [seed as u32, (seed >> 32) as u32]);
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

#[inline]
fn philox(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    for _ in 0..10 {
        let wide = |multiplier: u32, value: u32| {
            let product = u64::from(multiplier) * u64::from(value);
            ((product >> 32) as u32, product as u32)
        };
        let (high0, low0) = wide(0xD251_1F53, counter[0]);
        let (high1, low1) = wide(0xCD9E_8D57, counter[2]);
        counter = [
            high1 ^ counter[1] ^ key[0],
            low1,
            high0 ^ counter[3] ^ key[1],
            low0,
        ];
        key = [
            key[0].wrapping_add(0x9E37_79B9),
            key[1].wrapping_add(0xBB67_AE85),
        ];
    }
    counter
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Known answers of the authors' Random123 (`kat_vectors`).
    #[test]
    fn philox_gives_the_published_numbers() {
        assert_eq!(
            philox([0; 4], [0; 2]),
            [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]
        );
        assert_eq!(
            philox([u32::MAX; 4], [u32::MAX; 2]),
            [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]
        );
    }

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
