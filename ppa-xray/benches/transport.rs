//! Photon histories, rays and whole radiographs per second.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use ppa_benches::ProcessorTime;
use ppa_ct::Grid;
use ppa_phantom::{LowerLeg, TableTop};
use ppa_xray::{
    AnalogSettings, AntiScatterGrid, Collimation, Detector, DetectorModel, FastSettings, FocalSpot,
    HeelEffect, HuCalibration, Material, Projection, Source, Spectrum, TubeSpec, VoxelPhantom,
    analog, fast, primary,
};
use rayon::ThreadPoolBuilder;

/// A 20 cm water cube in 2 mm voxels with a 3 cm bone cylinder, as in case a of the reference data, optionally with a 4 mm x
/// 40 mm titanium screw.
fn cube(screw: bool) -> VoxelPhantom {
    let first = Point3::new(-99.0, -99.0, -99.0);
    let grid = Grid::axis_aligned([100; 3], Vector3::repeat(2.0), first).unwrap();
    let (material, density) = (0..grid.len())
        .map(|index| {
            let [x, y, z] = grid.voxel(index).map(|v| 2.0 * v as f64 - 99.0);
            if screw && x.hypot(z - 30.0) < 2.0 && y.abs() < 20.0 {
                (2, 4.54)
            } else if x.hypot(z) < 15.0 {
                (1, 1.92)
            } else {
                (0, 1.0)
            }
        })
        .unzip();
    let materials = ["water", "bone_cortical", "titanium"].map(|n| Material::named(n).unwrap());
    VoxelPhantom::new(grid, material, density, materials.to_vec()).unwrap()
}

fn projection(pixels: u32) -> Projection {
    Projection::new(
        Isometry3::translation(0.0, 0.0, -950.0),
        1_100.0,
        Detector::centred(pixels, pixels, 300.0 / f64::from(pixels)),
    )
}

fn spectrum() -> Spectrum {
    let filters = vec!["Al:2.5".parse().unwrap()];
    let tube = TubeSpec::new(60.0, 12.0, filters);
    Spectrum::tungsten(&tube).unwrap()
}

/// The built-in leg in 1 mm voxels with all tissue mixtures, whole or 15 cm around the joint; the joint is in the beam.
fn ankle(whole: bool, detector: Detector) -> (VoxelPhantom, Projection) {
    let limb = LowerLeg::p01();
    let joint = limb.truth().joint_centre;
    let mut volume = limb.voxelise(1.0, TableTop::Absent).unwrap();
    if !whole {
        let half = Vector3::repeat(75.0);
        volume = volume.crop_world(&(joint - half), &(joint + half)).unwrap();
    }
    let phantom = VoxelPhantom::from_volume(&volume, &HuCalibration::default(), None).unwrap();
    let from_front = Matrix3::from_columns(&[Vector3::x(), -Vector3::z(), Vector3::y()]);
    let rotation = Rotation3::from_matrix_unchecked(from_front);
    let pose = Translation3::from(joint)
        * UnitQuaternion::from_rotation_matrix(&rotation)
        * Isometry3::translation(0.0, 0.0, -1_000.0);
    (phantom, Projection::new(pose, 1_100.0, detector))
}

/// Histories per second of processor time, with one thread and with two.
fn histories(criterion: &mut Criterion<ProcessorTime>) {
    let spectrum = spectrum();
    let (leg, before_leg) = ankle(true, Detector::centred(300, 300, 0.8));
    let mut group = criterion.benchmark_group("analog");
    let settings = AnalogSettings::default()
        .with_histories(2_000_000)
        .with_seed(1);
    group.throughput(Throughput::Elements(settings.histories));
    group.sample_size(10);
    let scenes = [
        ("water_bone", cube(false), projection(300)),
        ("titanium_screw", cube(true), projection(300)),
        ("ankle", leg, before_leg),
    ];
    for (name, phantom, projection) in &scenes {
        for threads in [1, 2] {
            let pool = ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            group.bench_with_input(BenchmarkId::new(*name, threads), phantom, |b, phantom| {
                b.iter(|| pool.install(|| analog(phantom, &spectrum, projection, &settings)))
            });
        }
    }
}

/// Time to prepare a projection before its first history.
fn preparation(criterion: &mut Criterion<ProcessorTime>) {
    let spectrum = spectrum();
    let (leg, before_leg) = ankle(true, Detector::centred(300, 300, 0.8));
    let mut group = criterion.benchmark_group("preparation");
    let settings = AnalogSettings::default().with_histories(1).with_seed(1);
    group.throughput(Throughput::Elements(leg.grid().len() as u64));
    group.sample_size(10);
    group.bench_function("ankle", |b| {
        b.iter(|| analog(&leg, &spectrum, &before_leg, &settings).unwrap())
    });
}

/// Pixels per second of processor time: the primary alone, and complete radiographs equivalent to 2e10 histories.
fn images(criterion: &mut Criterion<ProcessorTime>) {
    let spectrum = spectrum();
    let mut group = criterion.benchmark_group("image");
    group.sample_size(10);
    for (pixels, pixel_mm) in [(300, 1.0), (1_500, 0.2)] {
        let (phantom, exposure) = ankle(false, Detector::centred(pixels, pixels, pixel_mm));
        group.throughput(Throughput::Elements(u64::from(pixels * pixels)));
        group.bench_with_input(BenchmarkId::new("primary", pixels), &exposure, |b, at| {
            b.iter(|| primary(&phantom, &spectrum, at, 2).unwrap())
        });
        let settings = FastSettings::default();
        group.bench_with_input(BenchmarkId::new("fast", pixels), &exposure, |b, at| {
            b.iter(|| fast(&phantom, &spectrum, at, &settings).unwrap())
        });
    }
}

/// Radiographs of the whole leg in 0.5 mm voxels, equivalent to 2e10 histories: with a point source and an ideal detector, and with all
/// options of the plan in docs/book/generate.md except blur and electronic noise, which cost nothing.
fn exposures(criterion: &mut Criterion<ProcessorTime>) {
    let spectrum = spectrum();
    let volume = LowerLeg::p01().voxelise(0.5, TableTop::Absent).unwrap();
    let phantom = VoxelPhantom::from_volume(&volume, &HuCalibration::default(), None).unwrap();
    let settings = FastSettings::default();
    let mut group = criterion.benchmark_group("exposure");
    group.sample_size(10);
    for (pixels, pixel_mm) in [(448, 0.5), (1_500, 0.15)] {
        let (_, ideal) = ankle(false, Detector::centred(pixels, pixels, pixel_mm));
        let mut real = ideal.clone();
        real.source = Source::default()
            .with_focal_spot(FocalSpot::default().with_size_mm(0.6))
            .with_heel_effect(Some(HeelEffect::new(-90.0)))
            .with_collimation(Collimation::Rectangle {
                size_mm: [180.0, 220.0],
                centre_mm: [0.0; 2],
            });
        real.receptor.model = DetectorModel::Csi {
            thickness_um: 600.0,
            packing: 0.8,
        };
        real.receptor.grid = Some(AntiScatterGrid::new(8.0, 40.0).with_focus_mm(Some(1_100.0)));
        for (name, exposure) in [("ideal", &ideal), ("real", &real)] {
            group.bench_with_input(BenchmarkId::new(name, pixels), exposure, |b, at| {
                b.iter(|| fast(&phantom, &spectrum, at, &settings).unwrap())
            });
        }
    }
}

criterion_group! {
    name = transport;
    config = Criterion::default().with_measurement(ProcessorTime);
    targets = histories, preparation, images, exposures
}
criterion_main!(transport);
