//! Reading DICOM: uncompressed slices of 512 x 512 pixels, and real series in every compressed encoding.
//!
//! The compressed series are in the shared data next to the repository; without them only the first is measured.

#[path = "../tests/it/series.rs"]
mod series;

use std::path::{Path, PathBuf};

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ppa_ct::read;
use series::{SliceSpec, write_series};

const SIDE: u16 = 512;
const SLICES: u16 = 64;

fn uncompressed(c: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let slice = |k: u16| {
        SliceSpec::axial([SIDE, SIDE], f64::from(k), |i, j| {
            ((i * 31 + j * 17) % 2000) as i16 - 1000
        })
    };
    write_series(folder.path(), &(0..SLICES).map(slice).collect::<Vec<_>>());
    let mut group = c.benchmark_group("dicom");
    group.sample_size(10);
    let pixels = u64::from(SIDE) * u64::from(SIDE) * u64::from(SLICES);
    group.throughput(Throughput::Elements(pixels));
    group.bench_function("uncompressed", |b| b.iter(|| read(folder.path())));
    group.finish();
}

fn compressed(c: &mut Criterion) {
    let shared = std::env::var_os("PPA_SHARED").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared"),
        PathBuf::from,
    );
    let mut group = c.benchmark_group("dicom");
    group.sample_size(10);
    for encoding in ["rle", "jpegll", "jpegls", "j2k"] {
        let folder = shared.join(format!("data/hand-reencoded/dicom-{encoding}"));
        if let Ok(scan) = read(&folder) {
            let pixels = scan.volume.values().len() as u64;
            group.throughput(Throughput::Elements(pixels));
            group.bench_function(encoding, |b| b.iter(|| read(&folder)));
        }
    }
    group.finish();
}

criterion_group!(benches, uncompressed, compressed);
criterion_main!(benches);
