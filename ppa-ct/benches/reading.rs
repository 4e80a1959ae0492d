//! Reading and writing each format: megabytes of stored voxels per second.

#[path = "../tests/it/series.rs"]
mod series;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ppa_ct::{read, write};
use series::{SliceSpec, write_series};

const SIDE: u16 = 256;
const SLICES: u16 = 64;

/// A limb-like disc with noise in air.
fn slice(k: u16) -> SliceSpec {
    SliceSpec::axial([SIDE, SIDE], f64::from(k), move |i, j| {
        let [x, y] = [i, j].map(|v| v as f32 - f32::from(SIDE) / 2.0);
        let noise = ((i * 31 + j * 17 + usize::from(k) * 7) * 2_654_435 % 41) as i16 - 20;
        let hu = if x.hypot(y) < 80.0 { 40 } else { -990 };
        hu + noise
    })
}

fn reading(c: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let series = folder.path().join("series");
    std::fs::create_dir(&series).expect("a writable folder");
    write_series(&series, &(0..SLICES).map(slice).collect::<Vec<_>>());
    let volume = read(&series).expect("the series just written").volume;
    let names = [
        "scan.nii",
        "scan.nii.gz",
        "scan.nrrd",
        "scan.mha",
        "scan.mhd",
    ];
    for name in names {
        write(&folder.path().join(name), &volume).expect("a writable folder");
    }

    let mut group = c.benchmark_group("scan");
    group.sample_size(10);
    group.throughput(Throughput::Bytes(2 * volume.values().len() as u64));
    group.bench_function("read_dicom_64_slices", |b| b.iter(|| read(&series)));
    for name in names {
        let path = folder.path().join(name);
        group.bench_function(format!("read_{name}"), |b| b.iter(|| read(&path)));
    }
    for name in names {
        let path = folder.path().join(format!("out_{name}"));
        group.bench_function(format!("write_{name}"), |b| {
            b.iter(|| write(&path, &volume))
        });
    }
    let slices = folder.path().join("slices");
    group.bench_function("write_dicom_64_slices", |b| {
        b.iter(|| {
            // A folder that is not empty is never overwritten.
            let _ = std::fs::remove_dir_all(&slices);
            write(&slices, &volume)
        })
    });
    group.finish();
}

criterion_group!(benches, reading);
criterion_main!(benches);
