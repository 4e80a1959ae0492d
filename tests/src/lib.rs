//! Noise shared by tests of several crates. Tests across crates are in the `tests` folder next to this file.

use ppa_core::random::split_mix_at;

/// SplitMix64 of (index + seed · 2³²), sum of two uniforms: in [-1, 1), triangular. The same as in the volumes and clouds of
/// `shared/reference/geometry`, which were the inputs of other programs.
pub fn hash_noise(index: u64, seed: u64) -> f64 {
    let z = split_mix_at(0, index + (seed << 32));
    let scale = f64::from(2.0_f32.powi(32));
    (z & 0xFFFF_FFFF) as f64 / scale + (z >> 32) as f64 / scale - 1.0
}
