//! The report of one test set, and the exact test from ten seeds to the largest number of pairs.
//!
//! Units of work: samples and sign patterns. The numbers are computed without a random seed.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use ppa_metrics::{evaluate, sign_flip_permutation};

/// Deterministic scattered numbers in [0, 1): multiples of the golden ratio.
fn scattered(count: usize) -> Vec<f64> {
    (1..=count)
        .map(|i| (i as f64 * 0.618_033_988_749_895).fract())
        .collect()
}

fn metrics(c: &mut Criterion) {
    let mut group = c.benchmark_group("metrics");
    group.sample_size(10);
    for count in [3_000, 100_000] {
        let predictions: Vec<f64> = scattered(count).iter().map(|x| 1.0 + 2.0 * x).collect();
        let labels: Vec<f64> = predictions
            .iter()
            .map(|y| (2.0 * y).round() / 2.0)
            .collect();
        group.throughput(Throughput::Elements(count as u64));
        group.bench_function(BenchmarkId::new("evaluate", count), |b| {
            b.iter(|| evaluate(&labels, &predictions))
        });
    }
    for pairs in [10, 24, 40] {
        let a = scattered(pairs);
        let b: Vec<f64> = a.iter().map(|x| x * x).collect();
        group.throughput(Throughput::Elements(1 << pairs));
        group.bench_function(BenchmarkId::new("sign_flip", pairs), |bench| {
            bench.iter(|| sign_flip_permutation(&a, &b))
        });
    }
    group.finish();
}

criterion_group!(benches, metrics);
criterion_main!(benches);
