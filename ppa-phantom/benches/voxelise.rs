//! Voxels per second of the analytic lower leg.

use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use ppa_phantom::{LowerLeg, TableTop};

fn voxelise(c: &mut Criterion) {
    let limb = LowerLeg::p01();
    let mut group = c.benchmark_group("phantom_voxelise_mm");
    group
        .sample_size(10)
        .warm_up_time(Duration::from_secs(1))
        .measurement_time(Duration::from_secs(10));
    for spacing_mm in [3.0, 1.5] {
        let voxels = limb
            .voxelise(spacing_mm, TableTop::Present)
            .expect("the spacing is in range")
            .grid()
            .len();
        group.throughput(Throughput::Elements(voxels as u64));
        group.bench_with_input(
            BenchmarkId::from_parameter(spacing_mm),
            &spacing_mm,
            |b, &spacing_mm| b.iter(|| limb.voxelise(spacing_mm, TableTop::Present)),
        );
    }
    group.finish();
}

criterion_group!(benches, voxelise);
criterion_main!(benches);
