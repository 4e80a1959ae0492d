//! The picture of a case and the coverage plot. CPU seconds of all threads.

use criterion::{Criterion, criterion_group, criterion_main};
use ppa_benches::ProcessorTime;
use ppa_depth::{Coverage, Viewpoint};
use ppa_generate::prepare;
use ppa_phantom::{LowerLeg, Side, TableTop};
use ppa_report::{RankedView, case_picture, coverage_plot};

fn pictures(c: &mut Criterion<ProcessorTime>) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scan = folder.path().join("p01.nii");
    let volume = LowerLeg::p01().voxelise(2.0, TableTop::Present);
    ppa_ct::write(&scan, &volume.expect("phantom")).expect("a writable folder");
    let side = Side::Right;
    let found = prepare(
        &scan,
        &Default::default(),
        side,
        &Default::default(),
        &Default::default(),
    );
    let (_, limb) = found.expect("a limb");

    let mut group = c.benchmark_group("pictures");
    group.sample_size(10);
    group.bench_function("case", |b| b.iter(|| case_picture("p01", &limb, &[])));
    let views: Vec<_> = Viewpoint::dome(10.0, 15.0, &[600.0, 800.0, 1000.0])
        .into_iter()
        .map(|viewpoint| RankedView {
            viewpoint,
            coverage: Coverage {
                visible_mm2: 0.0,
                visible_share: viewpoint.elevation_deg / 100.0,
                pixels: 0.0,
                pixels_per_cm2: viewpoint.distance_mm / 100.0,
                mm_per_pixel: None,
            },
        })
        .collect();
    group.bench_function("coverage_plot", |b| b.iter(|| coverage_plot(&views)));
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().with_measurement(ProcessorTime);
    targets = pictures
}
criterion_main!(benches);
