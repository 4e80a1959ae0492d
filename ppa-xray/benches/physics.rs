//! Materials, spectra and look-ups in them.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ppa_xray::{ComptonModel, Material, MaterialTables, ScatterDensities, Spectrum, TubeSpec};

/// Look-ups per iteration, at energies in irregular order as in a simulation.
const LOOKUPS: u64 = 1000;

fn tube() -> TubeSpec {
    let filters = vec![
        "Al:2.5".parse().expect("a filter"),
        "Cu:0.1".parse().expect("a filter"),
    ];
    TubeSpec::new(62.0, 11.0, filters)
}

/// Evenly distributed numbers from 0 to 1 in irregular order (golden-ratio sequence).
fn golden(i: u64) -> f64 {
    (i as f64 * 0.618_033_988_749_895).fract()
}

/// Energies sampled from the spectrum, in irregular order.
fn energies_kev(spectrum: &Spectrum) -> Vec<f64> {
    (0..LOOKUPS).map(|i| spectrum.sample(golden(i))).collect()
}

fn look_ups(criterion: &mut Criterion) {
    let bone = Material::named("bone_cortical").expect("in the library");
    let tables = MaterialTables::new(&bone, ComptonModel::default());
    let spectrum = Spectrum::tungsten(&tube()).expect("inside the tube model");
    let energies = energies_kev(&spectrum);

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

/// Scattering events per iteration, at energies of the spectrum; the random number generator costs about 1 ns per number.
fn scattering(criterion: &mut Criterion) {
    let spectrum = Spectrum::tungsten(&tube()).expect("inside the tube model");
    let energies = energies_kev(&spectrum);
    let mut state = 1_u64;
    let mut uniform = move || {
        // SplitMix64 (Steele, Lea, Flood 2014).
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ (mixed >> 31)) >> 32) as f64 * (1.0 / 4_294_967_296.0)
    };

    let mut group = criterion.benchmark_group("scatter");
    group.throughput(Throughput::Elements(LOOKUPS));
    for name in ["water", "bone_cortical"] {
        let material = Material::named(name).expect("in the library");
        for (model, label) in [
            (ComptonModel::ImpulseApproximation, "compton_impulse"),
            (ComptonModel::IncoherentFunction, "compton_incoherent"),
        ] {
            let tables = MaterialTables::new(&material, model);
            group.bench_function(format!("{label}/{name}"), |b| {
                b.iter(|| {
                    let one = |&e: &f64| tables.compton_scattering(black_box(e), &mut uniform);
                    energies
                        .iter()
                        .map(one)
                        .map(|found| found.sin2_half_theta * found.energy_kev)
                        .sum::<f64>()
                })
            });
        }
        let tables = MaterialTables::new(&material, ComptonModel::default());
        group.bench_function(format!("rayleigh/{name}"), |b| {
            b.iter(|| {
                let one = |&e: &f64| tables.rayleigh_sin2_half_theta(black_box(e), &mut uniform);
                energies.iter().map(one).sum::<f64>()
            })
        });
        let densities = ScatterDensities::new(&material, ComptonModel::default());
        group.bench_function(format!("densities/{name}"), |b| {
            b.iter(|| {
                energies
                    .iter()
                    .enumerate()
                    .map(|(i, &e)| {
                        let cos = 2.0 * golden(i as u64) - 1.0;
                        densities.compton_density(e, cos) + densities.rayleigh_density(e, cos)
                    })
                    .sum::<f64>()
            })
        });
    }
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
    group.bench_function("scatter_densities", |b| {
        b.iter(|| ScatterDensities::new(black_box(&bone), ComptonModel::default()))
    });
    group.bench_function("tungsten_spectrum", |b| {
        b.iter(|| Spectrum::tungsten(black_box(&tube)))
    });
    group.bench_function("half_value_layers", |b| {
        b.iter(|| black_box(&spectrum).hvl2_mm_al())
    });
    group.finish();
}

criterion_group!(benches, look_ups, scattering, preparation);
criterion_main!(benches);
