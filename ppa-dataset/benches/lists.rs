//! Benchmarks for the lists of a dataset of the paper's size: the manifest as text, the labels of one limb, a split by person.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ppa_dataset::labels::{LabelFile, LabelRow, LabelSource};
use ppa_dataset::layout::{LimbId, Side};
use ppa_dataset::{BodyShape, FileKind, FileRow, Manifest, Split};

const POSES: u32 = 181;

fn row(patient: u32, step: u32) -> FileRow {
    let limb = LimbId {
        patient,
        side: Side::Right,
    };
    let still = [
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ];
    FileRow {
        file: limb.radiograph_png(step),
        sha256: "0".repeat(64),
        kind: FileKind::Radiograph,
        limb,
        step,
        angle_deg: f64::from(step) / 2.0,
        camera: None,
        shape: BodyShape::Orig,
        volume_change_mm3: None,
        too_far_pixels: 0,
        cut_share: None,
        patient_from_ct: still,
        room_from_patient: still,
        ct_from_device: Some(still),
        mas: None,
        exposure_index: None,
        seed: Some(u64::from(step)),
    }
}

fn lists(c: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let rows = (0..17).flat_map(|patient| (0..POSES).map(move |step| row(patient, step)));
    let manifest = Manifest {
        root: folder.path().to_owned(),
        files: rows.collect(),
    };
    let path = folder.path().join(Manifest::FILE);
    std::fs::write(path, manifest.to_text()).expect("a writable folder");

    let mut group = c.benchmark_group("lists");
    group.throughput(Throughput::Elements(manifest.files.len() as u64));
    group.bench_function("manifest_to_text", |b| {
        b.iter(|| black_box(&manifest).to_text())
    });
    group.bench_function("manifest_read", |b| {
        b.iter(|| Manifest::read(folder.path()))
    });
    group.throughput(Throughput::Elements(u64::from(POSES)));
    group.bench_function("labels_of_a_limb", |b| {
        b.iter(|| {
            let grades = |step| LabelRow::of_grades(&[1.5, 2.0, 2.5], step);
            LabelFile::new(LabelSource::Readers, (0..POSES).filter_map(grades))
        })
    });
    let patients: Vec<u32> = (0..10_000).collect();
    let shares = [("train".to_owned(), 0.8), ("test".to_owned(), 0.2)];
    group.throughput(Throughput::Elements(patients.len() as u64));
    group.bench_function("split", |b| {
        b.iter(|| Split::draw(black_box(&patients), &shares, 1))
    });
    group.finish();
}

criterion_group!(benches, lists);
criterion_main!(benches);
