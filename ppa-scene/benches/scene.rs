//! Table search in the built-in room and in a recorded one, landmarks and placement of the phantom's skin.
//!
//! Times are processor seconds of all threads.

#[path = "../tests/it/recorded_room.rs"]
mod recorded_room;

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ppa_benches::ProcessorTime;
use ppa_mesh::{Border, iso_surface};
use ppa_phantom::{LowerLeg, TableTop};
use ppa_scene::{
    LandmarkOverrides, PlaneSettings, RoomSpec, Side, XrayRoom, find_landmarks, place, table_plane,
};

fn scene(criterion: &mut Criterion<ProcessorTime>) {
    let room = XrayRoom::parametric(&RoomSpec::default()).expect("default room");
    let settings = PlaneSettings::for_device(&room.device);
    let table = table_plane(&room.cloud, &settings, 1).expect("table");

    let mut group = criterion.benchmark_group("table_plane");
    group.sample_size(10);
    group.throughput(Throughput::Elements(room.cloud.points.len() as u64));
    group.bench_function("built_in_room", |b| {
        b.iter(|| table_plane(black_box(&room.cloud), &settings, 1))
    });
    // 1000 planes, as requested from Open3D's `segment_plane` by benches/peers/table_plane.py.
    let recorded = recorded_room::room_cloud(368_640, 11, 300.0..1400.0);
    group.throughput(Throughput::Elements(recorded.points.len() as u64));
    let settings = PlaneSettings::default();
    assert_eq!(settings.iterations, 1000);
    group.bench_function("recorded_room", |b| {
        b.iter(|| table_plane(black_box(&recorded), &settings, 1))
    });
    group.finish();

    let volume = LowerLeg::p01()
        .voxelise(1.5, TableTop::Absent)
        .expect("phantom");
    let skin = iso_surface(&volume, -500.0, Border::Open).expect("skin");
    let mask: Vec<bool> = volume.hu().iter().map(|hu| *hu >= -500.0).collect();
    let find = || {
        find_landmarks(
            &volume,
            &skin,
            &mask,
            Side::Right,
            &LandmarkOverrides::default(),
        )
    };
    let landmarks = find().expect("landmarks");

    let mut group = criterion.benchmark_group("find_landmarks");
    group.sample_size(10);
    group.throughput(Throughput::Elements(volume.grid().len() as u64));
    group.bench_function("p01_1.5mm", |b| b.iter(find));
    group.finish();

    let mut group = criterion.benchmark_group("place");
    group.throughput(Throughput::Elements(skin.vertices.len() as u64));
    for degrees in [0.0_f64, 45.0] {
        let angle = degrees.to_radians();
        group.bench_function(format!("p01_{degrees}_degrees"), |b| {
            b.iter(|| {
                let points = black_box(&skin.vertices);
                place(points, &landmarks, angle, &table.plane, &room.device)
            })
        });
    }
    // As many vertices as the surface of a whole scan with voxels of half a millimetre.
    let fine = LowerLeg::p01()
        .voxelise(0.5, TableTop::Absent)
        .expect("phantom");
    let skin = iso_surface(&fine, -500.0, Border::Open).expect("skin");
    group.throughput(Throughput::Elements(skin.vertices.len() as u64));
    group.bench_function("p01_0.5mm_45_degrees", |b| {
        b.iter(|| {
            let points = black_box(&skin.vertices);
            place(
                points,
                &landmarks,
                45_f64.to_radians(),
                &table.plane,
                &room.device,
            )
        })
    });
    group.finish();
}

criterion_group!(name = benches; config = Criterion::default().with_measurement(ProcessorTime); targets = scene);
criterion_main!(benches);
