//! Materials, spectra and their look-ups.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ppa_xray::{ComptonModel, Material, MaterialTables, Spectrum, TubeSpec};

/// Look-ups per iteration, at energies that jump about as those of histories do.
const LOOKUPS: u64 = 1000;

fn tube() -> TubeSpec {
    let filters = vec![
        "Al:2.5".parse().expect("a filter"),
        "Cu:0.1".parse().expect("a filter"),
    ];
    TubeSpec {
        kvp: 62.0,
        anode_angle_deg: 11.0,
        filters,
    }
}

fn look_ups(criterion: &mut Criterion) {
    let bone = Material::named("bone_cortical").expect("in the library");
    let tables = MaterialTables::new(&bone, ComptonModel::default());
    let spectrum = Spectrum::tungsten(&tube()).expect("inside the tube model");
    let golden = |i: u64| (i as f64 * 0.618_033_988_749_895).fract();
    let energies: Vec<f64> = (0..LOOKUPS).map(|i| spectrum.sample(golden(i))).collect();

    let mut group = criterion.benchmark_group("look_up");
    group.throughput(Throughput::Elements(LOOKUPS));
    group.bench_function("cross_sections_direct", |b| {
        b.iter(|| {
            energies
                .iter()
                .map(|&e| bone.total_cm2_g(e).expect("inside the tables"))
                .sum::<f64>()
        })
    });
    group.bench_function("cross_sections_tables", |b| {
        b.iter(|| {
            energies
                .iter()
                .map(|&e| tables.cross_sections(black_box(e)).total())
                .sum::<f64>()
        })
    });
    group.bench_function("spectrum_sample", |b| {
        b.iter(|| {
            (0..LOOKUPS)
                .map(|i| spectrum.sample(black_box(golden(i))))
                .sum::<f64>()
        })
    });
    group.finish();
}

fn preparation(criterion: &mut Criterion) {
    let bone = Material::named("bone_cortical").expect("in the library");
    let tube = tube();
    let spectrum = Spectrum::tungsten(&tube).expect("inside the tube model");

    let mut group = criterion.benchmark_group("prepare");
    group.throughput(Throughput::Elements(1));
    group.bench_function("material_tables", |b| {
        b.iter(|| MaterialTables::new(black_box(&bone), ComptonModel::default()))
    });
    group.bench_function("tungsten_spectrum", |b| {
        b.iter(|| Spectrum::tungsten(black_box(&tube)))
    });
    group.bench_function("half_value_layers", |b| {
        b.iter(|| black_box(&spectrum).hvl2_mm_al())
    });
    group.finish();
}

criterion_group!(benches, look_ups, preparation);
criterion_main!(benches);
