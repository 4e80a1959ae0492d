//! Sums over pixels, in parts that keep a device busy.

use candle_core::{Result, Tensor};

use crate::device::launch::Launch;

/// Threads that keep a device busy.
const THREADS: usize = 262_144;
/// Minimum number of terms per thread.
const TERMS: usize = 8;
/// Number of parts that one thread adds up before the sum is divided among threads again.
const FEW: usize = 128;

/// Returns the number of parts into which `values` sums over `terms` terms each are divided.
pub fn parts(values: usize, terms: usize) -> usize {
    (THREADS / values).clamp(1, terms.div_ceil(TERMS))
}

/// Computes the sum [..] of parts [parts, ..].
pub fn sum(mut parts: Tensor) -> Result<Tensor> {
    let mut shape = parts.dims().to_vec();
    let values: usize = shape[1..].iter().product();
    while 1 < shape[0] {
        let count = shape[0];
        let group = match count <= FEW {
            true => count,
            false => count.isqrt(),
        };
        shape[0] = count.div_ceil(group);
        let launch = Launch::of_values("sum_parts", &shape[..], &[values, count, group]);
        parts = launch.run(&[&parts])?;
    }
    parts.squeeze(0)
}
