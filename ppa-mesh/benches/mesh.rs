//! The hot paths: iso-surface of an analytic field and of the leg that other programs are measured on, limb of the phantom,
//! DBSCAN of a surface. Times are processor seconds of all threads.

mod leg;

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use linfa::prelude::{ParamGuard, Transformer};
use linfa_clustering::Dbscan;
use nalgebra::{Point3, Vector3};
use ndarray16::Array2;
use ppa_benches::ProcessorTime;
use ppa_ct::{Grid, Volume};
use ppa_mesh::{Border, LimbSettings, dbscan, extract_limb, iso_surface};
use ppa_phantom::{LowerLeg, TableTop};
use rayon::ThreadPoolBuilder;

/// A torus with a wavy skin in n³ voxels.
fn torus(n: usize) -> Volume {
    let grid = Grid::axis_aligned([n; 3], Vector3::repeat(128.0 / n as f64), Point3::origin());
    let grid = grid.expect("grid");
    let hu = (0..grid.len())
        .map(|at| {
            let p = grid.centre(grid.voxel(at).map(|v| v as f64)) - Point3::new(63.7, 64.1, 63.9);
            let around = (p.x.hypot(p.y) - 38.0).hypot(p.z);
            let waves = (0.4 * p.x).sin() + (0.5 * p.y).sin() + (0.3 * p.z).sin();
            (-500.0 - 100.0 * (around - 18.0 - waves)) as f32
        })
        .collect();
    Volume::new(grid, hu).expect("finite")
}

fn benches(c: &mut Criterion<ProcessorTime>) {
    let mut group = c.benchmark_group("iso_surface");
    group.sample_size(20);
    for n in [64, 128] {
        let field = torus(n);
        group.throughput(Throughput::Elements(field.grid().len() as u64));
        group.bench_with_input(BenchmarkId::new("voxels", n), &field, |b, field| {
            b.iter(|| iso_surface(black_box(field), -500.0, Border::Open));
        });
    }
    let leg = leg::leg();
    group.throughput(Throughput::Elements(leg.grid().len() as u64));
    for threads in [1, 2] {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.expect("threads");
        group.bench_with_input(BenchmarkId::new("leg_threads", threads), &leg, |b, leg| {
            b.iter(|| pool.install(|| iso_surface(black_box(leg), -500.0, Border::Open)));
        });
    }
    group.finish();

    let mut group = c.benchmark_group("dbscan");
    group.sample_size(10);
    let skin = iso_surface(&torus(64), -500.0, Border::Open).expect("surface");
    group.throughput(Throughput::Elements(skin.vertices.len() as u64));
    group.bench_function("surface_points", |b| {
        b.iter(|| dbscan(black_box(&skin.vertices), 4.0, 8));
    });
    // The library that our code replaces.
    let table = Array2::from_shape_fn((skin.vertices.len(), 3), |(row, axis)| {
        f64::from(skin.vertices[row][axis])
    });
    group.bench_function("surface_points_linfa", |b| {
        let parameters = Dbscan::params(8).tolerance(4.0).check().expect("positive");
        b.iter(|| parameters.transform(black_box(&table)));
    });
    group.finish();

    let mut group = c.benchmark_group("extract_limb");
    group.sample_size(10);
    let scan = LowerLeg::p01()
        .voxelise(2.5, TableTop::Present)
        .expect("phantom");
    group.throughput(Throughput::Elements(scan.grid().len() as u64));
    group.bench_function("phantom_2.5mm", |b| {
        b.iter(|| extract_limb(black_box(&scan), &LimbSettings::default()));
    });
    group.finish();
}

criterion_group! {
    name = mesh;
    config = Criterion::default().with_measurement(ProcessorTime);
    targets = benches
}
criterion_main!(mesh);
