//! Table search in the built-in room and placement of the phantom's skin.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ppa_ct::phantom::{LowerLeg, TableTop};
use ppa_mesh::{Border, iso_surface};
use ppa_scene::{
    LandmarkOverrides, PlaneSettings, Room, RoomSpec, Side, find_landmarks, place, table_plane,
};

fn scene(criterion: &mut Criterion) {
    let room = Room::parametric(&RoomSpec::default()).expect("default room");
    let settings = PlaneSettings::for_device(&room.device);
    let table = table_plane(&room.cloud, &settings, 1).expect("table");

    let mut group = criterion.benchmark_group("table_plane");
    group.sample_size(10);
    group.throughput(Throughput::Elements(room.cloud.points.len() as u64));
    group.bench_function("built_in_room", |b| {
        b.iter(|| table_plane(black_box(&room.cloud), &settings, 1))
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
    group.finish();
}

criterion_group!(benches, scene);
criterion_main!(benches);
