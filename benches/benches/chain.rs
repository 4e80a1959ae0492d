//! End-to-end waiting time of a user: preparing a case from a scan, and generating a pose of a dataset.

use std::path::Path;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use ppa_generate::{Plan, PlanCase, generate, prepare};
use ppa_phantom::{LowerLeg, TableTop};
use ppa_scene::{Side, Sweep};

const SPACING_MM: f64 = 1.5;

fn write_inputs(folder: &Path) -> Plan {
    let scan = folder.join("p01.nii");
    let volume = LowerLeg::p01()
        .voxelise(SPACING_MM, TableTop::Present)
        .unwrap();
    ppa_ct::write_nifti(&scan, &volume).unwrap();
    let (case, _) = prepare(
        &scan,
        &Default::default(),
        Side::Right,
        &Default::default(),
        &Default::default(),
    )
    .unwrap();
    let file = folder.join("p01.toml");
    case.write(&file).unwrap();
    Plan::new(vec![PlanCase { file, patient: 0 }])
}

fn chain(c: &mut Criterion) {
    let folder = tempfile::tempdir().unwrap();
    let mut plan = write_inputs(folder.path());
    let scan = folder.path().join("p01.nii");

    let mut group = c.benchmark_group("chain");
    group.sample_size(10);
    group.bench_function("prepare", |b| {
        b.iter(|| {
            prepare(
                &scan,
                &Default::default(),
                Side::Right,
                &Default::default(),
                &Default::default(),
            )
            .unwrap()
        });
    });
    // Ten depth images and a radiograph per pose; loading the case and the room is included.
    plan.rotation = Sweep {
        from_deg: 0.0,
        to_deg: 1.0,
        step_deg: 1.0,
    };
    group.throughput(Throughput::Elements(2));
    group.bench_function("generate/2_poses", |b| {
        b.iter_batched(
            || tempfile::tempdir().unwrap(),
            |out| {
                generate(
                    &plan,
                    &out.path().join("dataset"),
                    &Default::default(),
                    &|_| {},
                )
                .unwrap();
                out
            },
            BatchSize::PerIteration,
        );
    });
    group.finish();
}

criterion_group!(benches, chain);
criterion_main!(benches);
