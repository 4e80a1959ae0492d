//! The computed label of an ankle: separation of the bones, joint space, openness to one exposure. CPU seconds of all threads.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Isometry3, Matrix3, Rotation3, Vector3};
use ppa_benches::ProcessorTime;
use ppa_dataset::labels::BoneNumbers;
use ppa_label::{AnkleBones, Exposure, JointSpace, segment_bones};
use ppa_phantom::{LowerLeg, TableTop};

fn ankle(c: &mut Criterion<ProcessorTime>) {
    let leg = LowerLeg::p01();
    let joint = leg.truth().joint_centre;
    let reach = Vector3::repeat(62.0);
    let scan = leg
        .voxelise_box([joint - reach, joint + reach], 0.8, TableTop::Absent)
        .expect("phantom");
    let limb = vec![true; scan.grid().len()];
    let axes = Matrix3::from_columns(&[-Vector3::x(), -Vector3::y(), Vector3::z()]);
    let axes = Rotation3::from_matrix_unchecked(axes);
    let ct_from_patient = Isometry3::from_parts(joint.coords.into(), axes.into());

    let mut group = c.benchmark_group("ankle");
    group.sample_size(10);
    group.throughput(Throughput::Elements(scan.grid().len() as u64));
    let segment = || segment_bones(&scan, &limb, &ct_from_patient).expect("bones");
    group.bench_function("segment_bones", |b| b.iter(segment));
    let found = segment();
    let space = || {
        let numbers = BoneNumbers::default();
        let bones = AnkleBones::new(&found.grid, &found.labels, numbers, &joint).expect("bones");
        JointSpace::new(bones, &ct_from_patient).expect("a joint space")
    };
    group.bench_function("joint_space", |b| b.iter(space));
    let space = space();
    let from_front = Matrix3::from_columns(&[Vector3::x(), -Vector3::z(), Vector3::y()]);
    let device = Rotation3::from_matrix_unchecked(from_front);
    let ct_from_device = Isometry3::from_parts(joint.coords.into(), device.into())
        * Isometry3::translation(0.0, 0.0, -1000.0);
    let exposures = [Exposure::of_device(&ct_from_device, joint)];
    group.throughput(Throughput::Elements(1));
    group.bench_function("openness", |b| b.iter(|| space.openness(&exposures)));
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().with_measurement(ProcessorTime);
    targets = ankle
}
criterion_main!(benches);
