//! The noise that tests of several crates share. Tests across crates live in the `tests` folder beside this file.

/// SplitMix64 of (index + seed · 2³²), sum of two uniforms: in [-1, 1), triangular; the `hash_noise` of
/// `../shared/peers/geometry_bench.py`, so that other programs see the same volumes and clouds.
pub fn hash_noise(index: u64, seed: u64) -> f64 {
    let mut z = (index + (seed << 32) + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^= z >> 31;
    let scale = f64::from(2.0_f32.powi(32));
    (z & 0xFFFF_FFFF) as f64 / scale + (z >> 32) as f64 / scale - 1.0
}
