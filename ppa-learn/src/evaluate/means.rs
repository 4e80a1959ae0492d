//! Means of values by key.

/// Returns (key, mean value, number of values) of each key.
pub(crate) fn means(pairs: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64, usize)> {
    let mut pairs: Vec<(f64, f64)> = pairs.collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let of_key = |same: &[(f64, f64)]| {
        let sum: f64 = same.iter().map(|pair| pair.1).sum();
        (same[0].0, sum / same.len() as f64, same.len())
    };
    pairs.chunk_by(|a, b| a.0 == b.0).map(of_key).collect()
}
