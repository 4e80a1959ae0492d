//! Addressed random numbers per second, one stream per item as in transport and sensors.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ppa_core::random::{Philox, split_mix_at};

const ITEMS: u64 = 10_000;

fn random(c: &mut Criterion) {
    let mut group = c.benchmark_group("random");
    group.throughput(Throughput::Elements(ITEMS));
    group.bench_function("philox_first_number", |b| {
        let first = |index| Philox::new(black_box(42), 0, index).unit();
        b.iter(|| (0..ITEMS).map(first).sum::<f64>())
    });
    group.bench_function("philox_same_stream", |b| {
        b.iter(|| {
            let mut stream = Philox::new(black_box(42), 0, 0);
            (0..ITEMS).map(|_| stream.unit()).sum::<f64>()
        })
    });
    group.bench_function("split_mix", |b| {
        b.iter(|| (0..ITEMS).fold(0, |all, index| all ^ split_mix_at(black_box(42), index)))
    });
    group.finish();
}

criterion_group!(benches, random);
criterion_main!(benches);
