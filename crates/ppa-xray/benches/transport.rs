//! Photon histories, rays and whole radiographs per second.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Isometry3, Point3, Vector3};
use ppa_ct::Grid;
use ppa_xray::{
    AnalogSettings, Detector, FastSettings, Material, Projection, Spectrum, TubeSpec, VoxelPhantom,
    analog, fast, primary,
};

/// A 20 cm water cube in 2 mm voxels with a 3 cm bone cylinder, as in case a of the reference data;
/// optionally with a titanium screw of 4 mm x 40 mm.
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
    let tube = TubeSpec {
        kvp: 60.0,
        anode_angle_deg: 12.0,
        filters,
    };
    Spectrum::tungsten(&tube).unwrap()
}

fn transport(criterion: &mut Criterion) {
    let (spectrum, projection) = (spectrum(), projection(300));
    let mut group = criterion.benchmark_group("analog");
    let settings = AnalogSettings {
        histories: 200_000,
        seed: 1,
        ..AnalogSettings::default()
    };
    group.throughput(Throughput::Elements(settings.histories));
    group.sample_size(10);
    for (name, screw) in [("water_bone", false), ("titanium_screw", true)] {
        let phantom = cube(screw);
        group.bench_with_input(BenchmarkId::from_parameter(name), &phantom, |b, phantom| {
            b.iter(|| analog(phantom, &spectrum, &projection, &settings).unwrap())
        });
    }
}

fn images(criterion: &mut Criterion) {
    let (phantom, spectrum) = (cube(true), spectrum());
    let mut group = criterion.benchmark_group("image");
    group.sample_size(10);
    for pixels in [150, 300] {
        let projection = projection(pixels);
        group.throughput(Throughput::Elements(u64::from(pixels * pixels)));
        group.bench_with_input(
            BenchmarkId::new("primary", pixels),
            &projection,
            |b, projection| b.iter(|| primary(&phantom, &spectrum, projection, 2).unwrap()),
        );
        let settings = FastSettings {
            scatter_histories: 100_000,
            samples_per_side: 2,
            ..FastSettings::default()
        };
        group.bench_with_input(
            BenchmarkId::new("fast", pixels),
            &projection,
            |b, projection| b.iter(|| fast(&phantom, &spectrum, projection, &settings).unwrap()),
        );
    }
}

criterion_group!(benches, transport, images);
criterion_main!(benches);
